// The contacts: what was found, dropped and made, each with its frames on a bar, as the entries of a contact file.

const EDGE = 7; // so near to an end of a bar that end is dragged [pixels]
const KINDS = ["between", "plant", "look", "distance"]; // of entries, by the field that names what each is about

const about = (entry) => KINDS.find((kind) => kind in entry);
const names = (entry) => [entry[about(entry)]].flat().toSorted().join(",");
const sameParts = (one, other) => about(one) === about(other) && names(one) === names(other);
const rest = ({ frames, seconds, found, ...entry }) => JSON.stringify(Object.entries({ firmness: 1, keep: true, ...entry }).sort());

/** The entry of a contact file that was read from another, without what has no effect. */
const plain = ({ found, seconds, ...entry }) => entry;

/** Whether an entry is the one that a contact of the clip was made from. */
function isFrom(entry, contact) {
  const [first, last] = contact.entry.frames;
  const within = !entry.frames || (entry.frames[0] <= first && last <= entry.frames[1]);
  const dropped = contact.mark === "dropped";
  if (dropped) return entry.keep === false && sameParts(entry, contact.entry) && (!entry.frames || (entry.frames[0] <= last && first <= entry.frames[1]));
  return within && rest(entry) === rest(contact.entry);
}

/** The entries without a contact: one that was found is dropped in the frames that are not kept. */
export function without(entries, contact, kept = null) {
  if (contact.mark !== "found") return entries.filter((each) => !isFrom(each, contact));
  const [first, last] = contact.entry.frames;
  const key = about(contact.entry);
  const spans = !kept || kept[1] < first || last < kept[0] ? [[first, last]] : [[first, kept[0] - 1], [kept[1] + 1, last]];
  const drops = spans.filter(([from, to]) => from <= to).map((frames) => ({ [key]: contact.entry[key], frames, keep: false }));
  return [...entries, ...drops];
}

/** The entries with another in the place of a contact. */
export function replaced(entries, contact, entry) {
  return [...without(entries, contact, sameParts(entry, contact.entry) ? entry.frames : null), entry];
}

/** The entry that holds a contact in other frames; one that was found keeps its gap. */
function moved({ mark, entry }, frames) {
  if (mark !== "found") return { ...plain(entry), frames };
  if (entry.plant) return { plant: entry.plant, on: "where it is", frames };
  return { between: entry.between, gap: parseFloat(entry.found) || 0, frames };
}

const title = (entry) => ({
  between: () => entry.between.join(" and "),
  plant: () => `${entry.plant} rests`,
  look: () => `${entry.look} keeps its direction`,
  distance: () => entry.distance.join(" to "),
})[about(entry)]();

function made(tag, more, ...children) {
  const element = Object.assign(document.createElement(tag), more);
  element.append(...children);
  return element;
}

/** A bar in the frames of a contact, whose ends and middle can be dragged; `act(frames)` is called where it is let go. */
function barOf(contact, count, act, tell) {
  const bar = made("i", { className: "bar" });
  const track = made("div", { className: "track", title: "drag an end to stretch it, its middle to move it" }, bar);
  let frames = contact.entry.frames;
  const show = () => {
    bar.style.left = `${(100 * frames[0]) / count}%`;
    bar.style.width = `${(100 * (frames[1] + 1 - frames[0])) / count}%`;
    tell(frames);
  };
  show();
  if (contact.mark === "dropped") return track;
  track.onpointerdown = (down) => {
    const before = frames;
    const box = bar.getBoundingClientRect();
    const [left, right] = [Math.abs(down.clientX - box.left) < EDGE, Math.abs(down.clientX - box.right) < EDGE];
    if (!left && !right && (down.clientX < box.left || down.clientX > box.right)) return;
    track.setPointerCapture(down.pointerId);
    track.onpointermove = ({ clientX }) => {
      const step = Math.round(((clientX - down.clientX) / track.clientWidth) * count);
      let [first, last] = before;
      if (right) last = Math.min(Math.max(last + step, first), count - 1);
      else if (left) first = Math.max(Math.min(first + step, last), 0);
      else {
        const shift = Math.min(Math.max(step, -first), count - 1 - last);
        [first, last] = [first + shift, last + shift];
      }
      frames = [first, last];
      show();
    };
    track.onpointerup = track.onpointercancel = ({ type }) => {
      track.onpointermove = track.onpointerup = track.onpointercancel = null;
      if (type === "pointercancel") frames = before;
      show();
      if (String(frames) !== String(before)) act(frames);
    };
  };
  return track;
}

/** The row of a contact; `change(entries)` is called with the entries after what is done to it, `choose` when it is
 * pressed.
 */
function rowOf(contact, count, entries, change, choose) {
  const { mark, entry, parts } = contact;
  const told = made("small");
  const tell = ([first, last]) => { told.textContent = `${first} to ${last}${mark === "found" ? "" : `, ${mark}`}`; };
  const bar = barOf(contact, count, (frames) => change(replaced(entries, contact, moved(contact, frames))), tell);
  const name = made("button", { type: "button", className: "name", onclick: choose }, `${title(entry)} `, told);
  const word = { found: "Drop", dropped: "Keep", added: "Remove" }[mark];
  const button = made("button", { type: "button", textContent: word, onclick: () => change(without(entries, contact)) });
  button.dataset.testid = mark === "found" ? "drop-contact" : "keep-contact";
  const row = made("li", { className: mark }, name, button, bar);
  Object.assign(row.dataset, { testid: "contact", between: parts.join(","), frames: entry.frames.join("-"), mark });
  return row;
}

/** The rows of the contacts of a clip; those found that an entry replaces are left out. */
export function rowsOf(contacts, count, entries, change, choose) {
  const whole = contacts.map((each) => ({ ...each, entry: { frames: [0, count - 1], ...each.entry } }));
  const covers = (made, found) => made.mark === "added" && sameParts(made.entry, found.entry)
    && made.entry.frames[0] <= found.entry.frames[0] && found.entry.frames[1] <= made.entry.frames[1];
  const seen = whole.filter((each) => each.mark !== "found" || !whole.some((other) => covers(other, each)));
  return seen.map((each) => rowOf(each, count, entries, change, () => choose(each)));
}
