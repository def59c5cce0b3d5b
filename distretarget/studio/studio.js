// The page of the studio: an order as a plain object, a history of orders, and what the server made of the last one.

const $ = (id) => document.getElementById(id);
const EDITS = { start: "", end: "", speed: 1, turn: 0, mirror: false, loop: false };
const OPTIONS = { supports: "hold", skin: "auto", objective: "contact" };
const START = { clip: null, character: null, animation: null, in_place: false, contacts: [], map: {}, format: null, edits: {}, options: {} };

const known = new Map(); // what each file is, by its number
let order = structuredClone(START);
let past = [];
let future = [];
let done = null;
let asked = 0;
let saved = true;
let frame = 0; // of the player

// ---- the server

async function ask(path, body, headers = {}) {
  const response = await fetch(path, { method: body === undefined ? "GET" : "POST", body, headers });
  if (response.ok) return response;
  const fault = await response.json().catch(() => ({}));
  if (response.status === 409) throw new DOMException("overtaken", "AbortError");
  throw new Error(fault.error ?? `the studio does not answer (${response.status})`);
}

async function drop(file, role) {
  const place = $(`${role ?? "clip"}-what`);
  place.classList.remove("wrong");
  place.textContent = `reading ${file.name} ...`;
  try {
    const about = await (await ask("files", file, { "X-Name": encodeURIComponent(file.name) })).json();
    take(about, role);
  } catch (error) {
    place.classList.add("wrong");
    place.textContent = `${error.message.startsWith(file.name) ? "" : `${file.name}: `}${error.message}`;
  }
}

function take(about, role) {
  known.set(about.id, about);
  const skinned = about.character && !/\.bvh$/i.test(about.name);
  role ??= about.clip && !(skinned && (order.clip || !about.animations.length)) ? "clip" : "character";
  if (!about[role]) {
    const place = $(`${role}-what`);
    place.classList.add("wrong");
    place.textContent = `${about.name} has no ${role === "clip" ? "motion" : "character"}.`;
    return;
  }
  const change = { [role]: about.id };
  if (role === "clip") Object.assign(change, { animation: about.animations.length > 1 ? about.animations[0] : null, contacts: [] });
  if (role === "character") Object.assign(change, { map: {}, format: null });
  set(change);
}

async function solve() {
  const turn = ++asked;
  show();
  if (!order.clip || !order.character) return;
  state("solving");
  try {
    const found = await (await ask("solve", JSON.stringify(order))).json();
    if (turn !== asked) return;
    done = found;
    trouble("");
    state("done");
    showDone();
  } catch (error) {
    if (turn !== asked || error.name === "AbortError") return;
    state("idle");
    trouble(error.message);
  }
}

async function download(kind) {
  try {
    const response = await ask(`take/${kind}`, JSON.stringify(order));
    const name = JSON.parse(`"${response.headers.get("X-Name")}"`);
    keep(await response.blob(), name);
    saved = true;
  } catch (error) {
    trouble(error.message);
  }
}

function keep(blob, name) {
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
  past.push(order);
  future = [];
  order = next;
  saved = false;
  solve();
}

function step(from, to) {
  if (!from.length) return;
  to.push(order);
  order = from.pop();
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

// ---- what is shown

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
  const names = known.get(order.clip)?.animations ?? [];
  $("animation-row").hidden = names.length < 2;
  $("animation").replaceChildren(...names.map((name) => new Option(name, name, false, name === order.animation)));
  for (const [name, usual] of Object.entries(EDITS)) {
    const field = $(name);
    const value = order.edits[name] ?? usual;
    if (field.type === "checkbox") field.checked = value;
    else field.value = value;
  }
  for (const [name, usual] of Object.entries(OPTIONS)) $(name).value = order.options[name] ?? usual;
  $("in_place").checked = order.in_place;
  $("undo").disabled = !past.length;
  $("redo").disabled = !future.length;
  $("save").disabled = !order.clip && !order.character;
}

function showDone() {
  $("verdict").textContent = done.verdict;
  $("warnings").replaceChildren(...done.warnings.map((text) => element("li", text)));
  $("empty").hidden = true;
  $("report").hidden = false;
  $("report").src = `report/${done.id}#frame=${frame}`;
  $("taking").hidden = false;
  $("format").replaceChildren(...done.formats.map((kind) => new Option(kind, kind, false, kind === done.format)));
  $("command").textContent = done.command;
  $("parts").replaceChildren(...done.parts.map((part) => new Option(part)));
  $("contacts").replaceChildren(...done.contacts.map(contact));
  $("pairs").replaceChildren(...done.pairs.map(pair));
}

function element(tag, text, more = {}) {
  return Object.assign(document.createElement(tag), { textContent: text }, more);
}

function contact({ mark, entry, parts }) {
  const item = element("li", "", { className: mark });
  const [first, last] = entry.frames ?? [0, done.frames - 1];
  Object.assign(item.dataset, { testid: "contact", between: parts.join(","), frames: `${first}-${last}`, mark });
  const text = element("span", `${entry.plant ? `${entry.plant} rests` : parts.join(" and ")} `);
  text.append(element("small", `${first} to ${last}${mark === "found" ? "" : `, ${mark}`}`));
  const button = element("button", mark === "found" ? "Drop" : mark === "dropped" ? "Keep" : "Remove", { type: "button" });
  button.dataset.testid = mark === "found" ? "drop-contact" : "keep-contact";
  const key = entry.plant ? { plant: entry.plant } : { between: entry.between };
  const same = (each) => JSON.stringify(each.between ?? each.plant) === JSON.stringify(entry.between ?? entry.plant);
  button.onclick = () => {
    if (mark === "found") set({ contacts: [...order.contacts, { ...key, frames: [first, last], keep: false }] });
    else set({ contacts: order.contacts.filter((each) => !(same(each) && (mark === "dropped" ? each.keep === false : each.keep !== false))) });
  };
  item.append(text, button);
  return item;
}

function pair([joint, driver]) {
  const row = document.createElement("tr");
  const choice = document.createElement("select");
  choice.append(new Option("nothing", ""), ...done.joints.map((name) => new Option(name, name)));
  choice.value = driver ?? "";
  choice.setAttribute("aria-label", `what drives ${joint}`);
  choice.onchange = () => set({ map: { ...order.map, [joint]: choice.value || null } });
  const cell = document.createElement("td");
  cell.append(choice);
  row.append(element("td", joint), cell);
  return row;
}

// ---- what people do

for (const role of ["clip", "character"]) {
  $(role).onchange = (event) => [...event.target.files].forEach((file) => drop(file, role));
}
for (const name of ["start", "end"]) $(name).onchange = (event) => edit(name, event.target.value.trim());
for (const name of ["speed", "turn"]) $(name).onchange = (event) => edit(name, Number(event.target.value) || EDITS[name]);
for (const name of ["mirror", "loop"]) $(name).onchange = (event) => edit(name, event.target.checked);
for (const name of Object.keys(OPTIONS)) $(name).onchange = (event) => option(name, event.target.value);
$("in_place").onchange = (event) => set({ in_place: event.target.checked });
$("animation").onchange = (event) => set({ animation: event.target.value, contacts: [] });
$("undo").onclick = () => step(past, future);
$("redo").onclick = () => step(future, past);
$("format").onchange = (event) => set({ format: event.target.value });
$("download").onclick = () => download($("format").value);
for (const button of document.querySelectorAll("[data-take]")) button.onclick = () => download(button.dataset.take);
$("copy").onclick = () => navigator.clipboard.writeText(done.command);
$("make").onclick = () => {
  const frames = $("frames").value.match(/\d+/g)?.map(Number);
  const entry = { between: [$("one").value.trim(), $("other").value.trim()], gap: Number($("gap").value) };
  if (frames?.length) entry.frames = [frames[0], frames.at(-1)];
  set({ contacts: [...order.contacts, entry] });
};
$("save").onclick = () => {
  const files = Object.fromEntries(["clip", "character"].map((role) => [role, known.get(order[role])?.name ?? null]));
  const text = JSON.stringify({ format: "distretarget-project", version: 1, files, order }, null, 2);
  keep(new Blob([text], { type: "application/json" }), "project.json");
  saved = true;
};
$("open").onchange = async (event) => {
  try {
    const project = JSON.parse(await event.target.files[0].text());
    if (project.format !== "distretarget-project") throw new Error("it is no project of the studio");
    const numbers = {};
    for (const [role, name] of Object.entries(project.files)) {
      const about = [...known.values()].find((each) => each.name === name && each[role]);
      if (name && !about) throw new Error(`drop ${name} first, then open the project`);
      numbers[role] = about?.id ?? null;
    }
    set({ ...START, ...project.order, ...numbers });
  } catch (error) {
    trouble(`the project cannot be opened: ${error.message}`);
  }
  event.target.value = "";
};
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
  if (event.source === $("report").contentWindow && Number.isInteger(event.data?.frame)) frame = event.data.frame;
});
$("order").onsubmit = (event) => event.preventDefault();
for (const about of await (await ask("files")).json()) take(about);
show();
