// The list of contacts, found, dropped and added, each with a bar over its frames; changes are contact file entries.

const EDGE = 7; // a press this near to an end of a bar drags that end [pixels]
const KINDS = ["between", "plant", "look", "distance"]; // of entries: the field that names the parts of the body

const kindOf = (entry) => KINDS.find((kind) => kind in entry);
const partsOf = (entry) => [entry[kindOf(entry)]].flat().toSorted().join(",");
const sameParts = (one, other) => kindOf(one) === kindOf(other) && partsOf(one) === partsOf(other);
const comparable = ({ frames, seconds, found, ...entry }) => JSON.stringify(Object.entries({ firmness: 1, keep: true, ...entry }).sort());

/** An entry without the fields that have no effect. */
const effective = ({ found, seconds, ...entry }) => entry;

/** Whether a contact of the clip was made from an entry. */
function isFrom(entry, contact) {
  const [first, last] = contact.entry.frames;
  const within = !entry.frames || (entry.frames[0] <= first && last <= entry.frames[1]);
  const dropped = contact.mark === "dropped";
  if (dropped) return entry.keep === false && sameParts(entry, contact.entry) && (!entry.frames || (entry.frames[0] <= last && first <= entry.frames[1]));
  return within && comparable(entry) === comparable(contact.entry);
}

/** The entries without a contact; one that was found gets entries that drop it, except in the frames `kept`. */
export function without(entries, contact, kept = null) {
  if (contact.mark !== "found") return entries.filter((each) => !isFrom(each, contact));
  const [first, last] = contact.entry.frames;
  const key = kindOf(contact.entry);
  const spans = !kept || kept[1] < first || last < kept[0] ? [[first, last]] : [[first, kept[0] - 1], [kept[1] + 1, last]];
  const drops = spans.filter(([from, to]) => from <= to).map((frames) => ({ [key]: contact.entry[key], frames, keep: false }));
  return [...entries, ...drops];
}

/** The entries with one that replaces a contact. */
export function replaced(entries, contact, entry) {
  return [...without(entries, contact, sameParts(entry, contact.entry) ? entry.frames : null), entry];
}

/** The entry for a contact in other frames; one that was found keeps its gap. */
function retimed({ mark, entry }, frames) {
  if (mark !== "found") return { ...effective(entry), frames };
  if (entry.plant) return { plant: entry.plant, on: "where it is", frames };
  return { between: entry.between, gap: parseFloat(entry.found) || 0, frames };
}

const title = (entry) => ({
  between: () => entry.between.join(" and "),
  plant: () => `${entry.plant} rests`,
  look: () => `${entry.look} keeps its direction`,
  distance: () => entry.distance.join(" to "),
})[kindOf(entry)]();

function element(tag, more, ...children) {
  const made = Object.assign(document.createElement(tag), more);
  made.append(...children);
  return made;
}

/** A bar over the frames of a contact: `onMove(frames)` is called while its ends or middle are dragged, then `onDrop`. */
function barOf(contact, count, onDrop, onMove) {
  const bar = element("i", { className: "bar" });
  const track = element("div", { className: "track", title: "drag an end to stretch it, its middle to move it" }, bar);
  let frames = contact.entry.frames;
  const show = () => {
    bar.style.left = `${(100 * frames[0]) / count}%`;
    bar.style.width = `${(100 * (frames[1] + 1 - frames[0])) / count}%`;
    onMove(frames);
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
      if (String(frames) !== String(before)) onDrop(frames);
    };
  };
  return track;
}

/** The row of a contact; `change(entries)` is called with the new entries when it is changed, `choose` when it is
 * pressed.
 */
function rowOf(contact, count, entries, change, choose) {
  const { mark, entry, parts } = contact;
  const note = element("small");
  const showFrames = ([first, last]) => { note.textContent = `${first} to ${last}${mark === "found" ? "" : `, ${mark}`}`; };
  const bar = barOf(contact, count, (frames) => change(replaced(entries, contact, retimed(contact, frames))), showFrames);
  const name = element("button", { type: "button", className: "name", onclick: choose }, `${title(entry)} `, note);
  const label = { found: "Drop", dropped: "Keep", added: "Remove" }[mark];
  const button = element("button", { type: "button", textContent: label, onclick: () => change(without(entries, contact)) });
  button.dataset.testid = mark === "found" ? "drop-contact" : "keep-contact";
  const row = element("li", { className: mark }, name, button, bar);
  Object.assign(row.dataset, { testid: "contact", between: parts.join(","), frames: entry.frames.join("-"), mark });
  return row;
}

/** The rows of the contacts of a clip; a found contact that an added one replaces is left out. */
export function rowsOf(contacts, count, entries, change, choose) {
  const all = contacts.map((each) => ({ ...each, entry: { frames: [0, count - 1], ...each.entry } }));
  const covers = (added, found) => added.mark === "added" && sameParts(added.entry, found.entry)
    && added.entry.frames[0] <= found.entry.frames[0] && found.entry.frames[1] <= added.entry.frames[1];
  const shown = all.filter((each) => each.mark !== "found" || !all.some((other) => covers(other, each)));
  return shown.map((each) => rowOf(each, count, entries, change, () => choose(each)));
}
