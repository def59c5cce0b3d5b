// The page of the studio: the order as a plain object, a history of orders, and the result of the last one.

import { replaced, rowsOf } from "./contacts.js";

const $ = (id) => document.getElementById(id);
const EDITS = { start: "", end: "", speed: 1, turn: 0, mirror: false, loop: false };
const OPTIONS = { supports: "hold", skin: "auto", objective: "contact", root_follows: "" };
const TAB = crypto.randomUUID(); // a later order of the same tab replaces one that is not done
const AROUND = 0.25; // duration of a clicked contact before and after the shown frame [s]
const PART = /^(.*?)(?: at (-?[\d.]+), (-?[\d.]+))?$/; // a part, and an anchor on its skin: along its axis, round it
const START = { clip: null, character: null, animation: null, fps: null, in_place: false, contacts: [], map: {}, rest: null, format: null, edits: {}, options: {} };

const known = new Map(); // the descriptions of files by id
const lastOrders = new Map(); // the last order of each clip, by the clip's key
let order = structuredClone(START);
let past = [];
let future = [];
const waiting = []; // motions for the player until it is ready; each builds on the ones before
let playerHas = []; // the hashes of the motions and bodies that the player has
let done = null; // the data of the finished order, except its motions
let requests = 0; // number of orders sent
let saved = true;
let ready = false; // whether the player is loaded
let frame = 0; // shown by the player
let chosen = null; // the contact whose values are in the fields
let firstPart = ""; // of a contact between two, once clicked
let shownPairs = []; // of joints, marked in the player and in the list
let driver = null; // the clicked joint of the source, until a joint of the character is clicked

// ---- the server

async function ask(path, body, headers = {}) {
  const response = await fetch(path, { method: body === undefined ? "GET" : "POST", body, headers: { "X-Tab": TAB, ...headers } });
  if (response.ok) return response;
  const fault = await response.json().catch(() => ({}));
  if (response.status === 409) throw new DOMException("superseded", "AbortError");
  throw new Error(fault.error ?? `the studio does not answer (${response.status})`);
}

const drop = (file, role) => add(file.name, role, () => ask("files", file, { "X-Name": encodeURIComponent(file.name) }));
const sample = (name) => add(name, name.endsWith(".bvh") ? "clip" : "character", () => ask(`samples/${name}`, ""));

/** Adds a file that `send` uploads; an error is shown in the field of the file. */
async function add(name, role, send) {
  const place = $(`${role ?? "clip"}-what`);
  place.classList.remove("wrong");
  place.textContent = `reading ${name} ...`;
  try {
    accept(await (await send()).json(), role);
  } catch (error) {
    place.classList.add("wrong");
    place.textContent = `${error.message.startsWith(name) ? "" : `${name}: `}${error.message}`;
  }
}

/** Uses a file as clip or character of the order. */
function accept(about, role) {
  known.set(about.id, about);
  const skinned = about.character && !/\.bvh$/i.test(about.name);
  role ??= about.clip && !(skinned && (order.clip || !about.animations.length)) ? "clip" : "character";
  if (!about[role]) {
    const place = $(`${role}-what`);
    place.classList.add("wrong");
    place.textContent = `${about.name} has no ${role === "clip" ? "motion" : "character"}.`;
    return;
  }
  about.isClip ||= role === "clip";
  if (role === "clip") set(ofClip(clipsIn(about)[0]));
  else set({ character: about.id, map: {}, format: null });
}

async function solve() {
  const request = ++requests;
  if (!order.clip || !order.character) return;
  state("solving");
  try {
    const given = JSON.stringify(order);
    const motions = await (await ask("solve", given, { "X-Has": playerHas.join() })).json();
    if (request !== requests) return;
    showMotions(motions);
    const found = await (await ask("judge", given, { "X-Tab": `${TAB}-judge` })).json(); // later orders do not stop it
    if (request !== requests) return;
    done = found;
    trouble("");
    state("done");
    showDone();
  } catch (error) {
    if (request !== requests) return;
    if (error.name === "AbortError") return solve(); // an earlier order reached the server later
    state("idle");
    trouble(error.message);
  }
}

async function download(kind, orders = order) {
  const before = $("state").textContent;
  state("writing");
  try {
    await save(await ask(`take/${kind}`, JSON.stringify(orders), { "X-Tab": `${TAB}-take` })); // later orders do not stop it
    trouble("");
  } catch (error) {
    trouble(error.message);
  }
  if ($("state").textContent === "writing") state(before);
}

/** The orders to download: the one that is shown, or the last one of every clip, all with this character. */
const chosenOrders = () => ($("which").value === "this" ? order : clips().map(orderOf));

/** Shows the command line that makes the download. */
async function showCommand() {
  const request = requests;
  const which = $("which").value;
  const text = which === "this" ? done.command : await (await ask(`command/${which}`, JSON.stringify(chosenOrders()))).text();
  if (request === requests && which === $("which").value) $("command").textContent = text;
}

async function save(response) {
  saveAs(await response.blob(), JSON.parse(`"${response.headers.get("X-Name")}"`));
  saved = true;
}

function saveAs(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

// ---- orders

function set(change) {
  const next = { ...order, ...change };
  if (JSON.stringify(next) === JSON.stringify(order)) return;
  if (order.clip) lastOrders.set(keyOf(order), order);
  past.push(order);
  future = [];
  order = next;
  saved = false;
  show();
  solve();
}

/** The clips: each animation of each file. */
const clips = () => [...known.values()].filter((about) => about.isClip).flatMap(clipsIn);
const clipsIn = ({ id, animations }) => (animations.length > 1 ? animations : [null]).map((animation) => ({ clip: id, animation }));
const nameOf = ({ clip, animation }) => (animation === null ? known.get(clip).name : `${known.get(clip).name}: ${animation}`);
const keyOf = ({ clip, animation }) => `${clip} ${animation}`;

/** The fields of an order that depend on the clip, from the clip's last order if there was one. */
function ofClip(clip) {
  const { contacts, edits } = keyOf(clip) === keyOf(order) ? order : lastOrders.get(keyOf(clip)) ?? { contacts: [], edits: {} };
  return { ...clip, contacts, edits };
}

const orderOf = (clip) => ({ ...order, ...ofClip(clip) });

function step(from, to) {
  if (!from.length) return;
  to.push(order);
  order = from.pop();
  show();
  solve();
}

function edit(name, value) {
  const edits = { ...order.edits };
  if (value === EDITS[name] || value === "") delete edits[name];
  else edits[name] = value;
  set({ edits });
}

function option(name, value) {
  const options = { ...order.options };
  if (value === OPTIONS[name]) delete options[name];
  else options[name] = value;
  set({ options });
}

// ---- showing

function state(text) {
  $("state").textContent = text;
}

function trouble(text) {
  $("trouble").textContent = text;
  $("trouble").hidden = !text;
}

function show() {
  for (const role of ["clip", "character"]) {
    const about = known.get(order[role]);
    if (!about) continue;
    const frames = role === "clip" && about.frames ? `, ${about.frames} frames, ${about.seconds.toFixed(1)} s` : "";
    $(`${role}-what`).classList.remove("wrong");
    $(`${role}-what`).textContent = `${about.name}${frames}`;
  }
  const all = clips();
  $("clips-row").hidden = $("which").hidden = all.length < 2;
  $("clips").replaceChildren(...all.map((clip, number) => new Option(nameOf(clip), number, false, keyOf(clip) === keyOf(order))));
  for (const [name, initial] of Object.entries(EDITS)) {
    const field = $(name);
    const value = order.edits[name] ?? initial;
    if (field.type === "checkbox") field.checked = value;
    else field.value = value;
  }
  for (const [name, initial] of Object.entries(OPTIONS)) $(name).value = order.options[name] ?? initial;
  $("in_place").checked = order.in_place;
  $("fps").value = order.fps ?? "";
  $("no-rest").hidden = !order.rest;
  for (const [name, orders] of [["undo", past], ["redo", future]]) {
    if (!orders.length) $(name).blur(); // a disabled button with the focus would swallow keys
    $(name).disabled = !orders.length;
  }
  $("save").disabled = !order.clip || !order.character;
}

function showMotions(motions) {
  playerHas = [...motions.actors, ...motions.bodies].map((one) => one.hash ?? one);
  $("empty").hidden = true;
  for (const name of ["verdict", "taking", "touching"]) $(name).hidden = false;
  $("player").inert = false;
  if (ready) tellPlayer({ motions });
  else waiting.push({ motions });
}

function showDone() {
  if (ready) tellPlayer({ timeline: done.timeline });
  $("verdict").replaceChildren(...done.verdict.map(remark));
  $("warnings").replaceChildren(...done.warnings.map((each) => row("li", remark(each))));
  $("format").replaceChildren(...done.formats.map((kind) => new Option(kind, kind, false, kind === done.format)));
  $("which").options[2].disabled = !done.merges;
  if (!done.merges && $("which").value === "merged") $("which").value = "each";
  showCommand();
  $("parts").replaceChildren(...done.parts.map((part) => new Option(part)));
  $("contacts").replaceChildren(...rowsOf(done.contacts, done.frames, order.contacts, change, choose));
  chosen = null;
  $("change").disabled = true;
  showDrivers();
  showPairs(shownPairs);
}

function element(tag, text, more = {}) {
  return Object.assign(document.createElement(tag), { textContent: text }, more);
}

function row(tag, ...children) {
  const made = document.createElement(tag);
  made.append(...children);
  return made;
}

/** Fills the fields with the values of a contact, to be changed. */
function choose(contact) {
  chosen = contact;
  const { entry } = contact;
  const kind = ["between", "plant", "look"].find((each) => each in entry);
  if (!kind) return;
  [$("one").value, $("other").value = ""] = [entry[kind]].flat().map((part, k) => withAnchor(part, entry.anchors?.[k]));
  $("kind").value = kind;
  $("frames").value = entry.frames.join("-");
  $("gap").value = entry.gap ?? (parseFloat(entry.found) || 0);
  $("firmness").value = entry.firmness ?? 1;
  showKind();
  for (const row of $("contacts").children) row.classList.toggle("chosen", row.dataset.between === contact.parts.join(",") && row.dataset.frames === entry.frames.join("-"));
  $("change").disabled = contact.mark === "dropped";
  if (contact.mark !== "dropped") goTo(entry.frames[0]);
}

function showKind() {
  for (const field of document.querySelectorAll(".of-between")) field.hidden = $("kind").value !== "between";
}

/** The entry of a contact file from the fields. */
function entryOfFields() {
  const frames = $("frames").value.match(/\d+/g)?.map(Number);
  const span = frames?.length ? { frames: [frames[0], frames.at(-1)] } : {};
  const [[, one, ...first], [, other, ...second]] = ["one", "other"].map((id) => $(id).value.trim().match(PART));
  if ($("kind").value === "plant") return { plant: one, on: "where it is", ...span };
  if ($("kind").value === "look") return { look: one, like: "source", ...span };
  const firmness = Number($("firmness").value);
  const firm = firmness === 1 ? {} : { firmness };
  const anchors = first[0] && second[0] ? { anchors: [first.map(Number), second.map(Number)] } : {};
  return { between: [one, other], gap: Number($("gap").value), ...firm, ...anchors, ...span };
}

function change(contacts) {
  set({ contacts });
}

const tellPlayer = (message) => $("player").contentWindow.postMessage(message, "*");

const goTo = (to) => tellPlayer({ frame: to });

/** A sentence of the verdict or a warning; if it is about a frame, a link to that frame and its joints. */
function remark({ text, frame: at, joints }) {
  if (at === null) return text;
  return element("a", text, { href: `#frame=${at}`, onclick: (event) => {
    event.preventDefault();
    showPairs(joints.map((joint) => [driverOf(joint), joint]), { frame: at, close: true });
  } });
}

const withAnchor = (part, anchor) => (anchor ? `${part} at ${anchor.join(", ")}` : part);

/** The text of a clicked part of the body and, for parts that touch, of the anchor on its skin as in contact files. */
function textOfClick(joint, at) {
  const axes = at && $("kind").value === "between" ? done.axes[joint] : null;
  if (!axes) return done.target_joints[joint];
  const off = at.map((x, k) => x - axes.start[k]);
  const [along, side, front] = axes.directions.map((direction) => direction.reduce((sum, x, k) => sum + x * off[k], 0));
  const anchor = [(along / axes.length).toFixed(3), ((Math.atan2(side, front) * 180) / Math.PI).toFixed(0)];
  return withAnchor(axes.name, anchor.map(Number));
}

/** Handles a click on a part of the body; the last part of a contact adds it, around the shown frame. */
function picked(joint, at) {
  const both = $("kind").value === "between";
  const text = textOfClick(joint, at);
  const [, name] = text.match(PART);
  const complete = !both || (firstPart && firstPart !== name);
  $(both && complete ? "other" : "one").value = text;
  firstPart = name;
  pick(!complete);
  if (!complete) return;
  const around = Math.round(AROUND / done.frame_time);
  $("frames").value = `${Math.max(frame - around, 0)}-${Math.min(frame + around, done.frames - 1)}`;
  change([...order.contacts, entryOfFields()]);
}

function pick(on) {
  if (!on) firstPart = "";
  $("pick").setAttribute("aria-pressed", on);
  $("pick").textContent = !on ? "Click parts on the body" : firstPart ? `${firstPart} and ...` : "Click a part ...";
}

/** Selects a joint of the source as the driver of the joint of the character that is selected next. */
function takeDriver(key) {
  driver = key;
  showPair(key, null);
}

/** Selects a joint of the character: the selected driver is mapped to it; without one, its present pair is shown. */
function takeDriven(key) {
  const drives = driver ?? driverOf(key);
  const isNew = driver !== null;
  driver = null;
  showPair(drives, key);
  if (isNew) set({ map: { ...order.map, [key]: drives } });
}

const driverOf = (key) => done.pairs.find(([joint]) => joint === key)?.[1] ?? null;

/** Marks pairs of joints, either of which may be null, in the player and in the list. */
function showPairs(pairs, more = {}) {
  shownPairs = pairs.filter(([drives, driven]) => done.target_joints.includes(driven) || done.source_joints.includes(drives));
  tellPlayer({ ...more, pairs: shownPairs.map(([drives, driven]) => [done.source_joints.indexOf(drives), done.target_joints.indexOf(driven)]) });
  for (const { classList, dataset } of $("pairs").children) classList.toggle("chosen", shownPairs.some(([, driven]) => driven === dataset.driven));
}

/** Marks a pair, and says it in a sentence. */
function showPair(drives, driven) {
  showPairs([[drives, driven]]);
  $("pairing").textContent = driven ? `${drives ?? "nothing"} drives ${driven}.` : drives ? `${drives} drives ... Click a joint of the copy or the result.`
    : "Click a joint of the source, then one of the copy or the result; or choose here.";
}

/** Lists the pairs of joints, and joints without a partner; while the list is open, each pair has a colour. */
function showDrivers() {
  const tones = new Map(done.pairs.flatMap(([, drives]) => drives ?? []).map((key, k) => [key, `hsl(${Math.round(137.5 * k) % 360}, 80%, 52%)`]));
  const drives = new Map(done.pairs);
  const rows = done.pairs.map(([joint, by]) => pairRow(joint, by, tones.get(by)));
  const unused = Array.from(new Set(done.source_joints)).filter((key) => !tones.has(key));
  const section = (title, some) => (some.length ? [row("tr", element("th", `${title} (${some.length})`, { colSpan: 3 })), ...some] : []);
  $("pairs").replaceChildren(...section("Driven", rows.filter((_, k) => done.pairs[k][1])), ...section("Driven by nothing", rows.filter((_, k) => !done.pairs[k][1])),
    ...section("Drive nothing", unused.map((key) => row("tr", element("td", ""), row("td", jointButton(key, takeDriver))))));
  const dots = (keys, tone) => keys.map((key, k) => (keys.indexOf(key) < k ? "" : tones.get(tone(key)) ?? "#888"));
  tellPlayer({ dots: $("who").open ? [dots(done.source_joints, (key) => key), dots(done.target_joints, (key) => drives.get(key))] : [[], []] });
}

const jointButton = (key, take) => element("button", key, { type: "button", className: "name", onclick: () => take(key) });

function pairRow(joint, drives, tone) {
  const choice = document.createElement("select");
  choice.append(new Option("nothing", ""), ...Array.from(new Set([...done.source_joints, drives].filter(Boolean)), (name) => new Option(name, name)));
  choice.value = drives ?? "";
  choice.setAttribute("aria-label", `what drives ${joint}`);
  choice.onfocus = () => driver || showPair(drives, joint);
  choice.onchange = () => set({ map: { ...order.map, [joint]: choice.value || null } });
  const dot = element("i", "", { className: "dot" });
  dot.style.background = tone ?? "";
  const made = row("tr", row("td", dot), row("td", jointButton(joint, takeDriven)), row("td", choice));
  made.dataset.driven = joint;
  return made;
}

// ---- events

for (const role of ["clip", "character"]) {
  $(role).onchange = (event) => [...event.target.files].forEach((file) => drop(file, role));
}
for (const name of ["start", "end"]) $(name).onchange = (event) => edit(name, event.target.value.trim());
for (const name of ["speed", "turn"]) $(name).onchange = (event) => edit(name, Number(event.target.value) || EDITS[name]);
for (const name of ["mirror", "loop"]) $(name).onchange = (event) => edit(name, event.target.checked);
for (const name of Object.keys(OPTIONS)) $(name).onchange = (event) => option(name, event.target.value);
$("fps").onchange = (event) => set({ fps: Number(event.target.value) || null });
$("in_place").onchange = (event) => set({ in_place: event.target.checked });
$("clips").onchange = (event) => set(ofClip(clips()[event.target.value]));
for (const button of document.querySelectorAll("[data-sample]")) button.onclick = () => sample(button.dataset.sample);
$("try").onclick = () => ["clap.bvh", "hero.glb"].forEach(sample);
$("undo").onclick = () => step(past, future);
$("redo").onclick = () => step(future, past);
$("who").ontoggle = () => {
  driver = null;
  if ($("who").open) pick(false);
  if (!done) return;
  showPair(null, null);
  showDrivers();
  $("who").scrollIntoView({ block: "nearest" });
};
$("format").onchange = (event) => set({ format: event.target.value });
$("which").onchange = showCommand;
$("download").onclick = () => ($("which").value === "this" ? download($("format").value) : download($("which").value, chosenOrders()));
$("zip").onclick = () => download($("which").value === "merged" ? "merged-zip" : "zip", chosenOrders());
for (const button of document.querySelectorAll("[data-take]")) button.onclick = () => download(button.dataset.take);
$("copy").onclick = () => navigator.clipboard.writeText($("command").textContent);
$("make").onclick = () => change([...order.contacts, entryOfFields()]);
$("change").onclick = () => change(replaced(order.contacts, chosen, entryOfFields()));
$("kind").onchange = showKind;
$("pick").onclick = () => pick($("pick").getAttribute("aria-pressed") !== "true");
$("save").onclick = () => download("project", [order, ...clips().filter((clip) => keyOf(clip) !== keyOf(order)).map(orderOf)]);
$("rest").onchange = async (event) => {
  const [file] = event.target.files;
  try {
    set({ rest: await (await ask("rest", file, { "X-Name": encodeURIComponent(file.name) })).json() });
  } catch (error) {
    trouble(error.message);
  }
  event.target.value = "";
};
$("no-rest").onclick = () => set({ rest: null });
/** Lets a button open a JSON file of a format; `use(content)` may throw an error, which is shown. */
const opens = (id, format, what, use) => {
  $(id).onchange = async (event) => {
    const [file] = event.target.files;
    try {
      const found = JSON.parse(await file.text());
      if (found?.format !== format) throw new Error(`it is no ${what}`);
      use(found);
    } catch (error) {
      trouble(`${file.name} cannot be opened: ${error.message}`);
    }
    event.target.value = "";
  };
};
opens("open-contacts", "distretarget-contacts", "contact file", ({ contacts }) => change(contacts));
/** The dropped file that a project names as clip or character. */
function inProject(role, { name, hash }) {
  const about = [...known.values()].find((each) => each.hash === hash && each[role]);
  const other = [...known.values()].some((each) => each.name === name);
  if (!about) throw new Error(other ? `the ${name} that was dropped is not the one of the project` : `drop ${name} first, then open the project`);
  return about;
}

opens("open", "distretarget-project", "project of the studio", ({ format, version, files, output, other_clips = [], ...settings }) => {
  const abouts = [files.clip, ...other_clips].map((clip) => inProject("clip", clip));
  const others = other_clips.map(({ name, hash, ...own }, k) => ({ ...START, ...own, clip: abouts[k + 1].id }));
  const character = inProject("character", files.character).id;
  for (const about of abouts) about.isClip = true;
  set({ ...START, ...settings, clip: abouts[0].id, character, format: output });
  for (const other of others) lastOrders.set(keyOf(other), other);
});
addEventListener("keydown", (event) => {
  if (!(event.ctrlKey || event.metaKey) || event.key.toLowerCase() !== "z" || event.target.matches("input:not([type=checkbox])")) return;
  event.preventDefault();
  if (event.shiftKey) step(future, past);
  else step(past, future);
});
addEventListener("dragover", (event) => {
  event.preventDefault();
  for (const place of document.querySelectorAll(".drop")) place.classList.toggle("over", place.contains(event.target));
});
addEventListener("dragleave", () => document.querySelectorAll(".drop").forEach((place) => place.classList.remove("over")));
addEventListener("drop", (event) => {
  event.preventDefault();
  const role = event.target.closest?.(".drop")?.id.replace("-drop", "");
  document.querySelectorAll(".drop").forEach((place) => place.classList.remove("over"));
  [...event.dataTransfer.files].forEach((file) => drop(file, role));
});
addEventListener("beforeunload", (event) => {
  if (!saved) event.preventDefault();
});
addEventListener("message", (event) => {
  if (event.source !== $("player").contentWindow) return;
  if (event.data?.ready) {
    ready = true;
    waiting.splice(0).forEach(tellPlayer);
    if (done) tellPlayer({ timeline: done.timeline });
  }
  if (Number.isInteger(event.data?.frame)) frame = event.data.frame;
  const { joint = -1, skin, at, role } = event.data ?? {};
  if ($("pick").getAttribute("aria-pressed") === "true") {
    if (role !== "source" && Math.max(joint, skin) >= 0) picked(skin < 0 ? joint : skin, at);
  } else if ($("who").open && joint >= 0) {
    if (role === "source") takeDriver(done.source_joints[joint]);
    else takeDriven(done.target_joints[joint]);
  }
});
$("player").src = "player"; // only now, so that the page hears it when the player is ready
$("order").onsubmit = (event) => event.preventDefault();
for (const about of await (await ask("files")).json()) accept(about);
show();
