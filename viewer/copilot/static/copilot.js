// The co-pilot display: takes frames from the server and shows each whole; keeps nothing but the last.
import { Plan } from "./drawing.js";
import { beep, speak, wake } from "./sound.js";

const element = (id) => document.getElementById(id);
const OLD_S = 1.2;        // a frame that was made so long ago is not current
const AGAIN_MS = 5000;    // between two calls for the newest frame in place of those that wait
const CLOCK_MS = 5000, DRIFT = 2e-4;
const NOTE_MS = 15000;
const LEVELS = ["none", "calm", "watch", "danger"];
const WORDS = { none: "no futures", calm: "calm", watch: "watch", danger: "danger" };
const SIGNS = {
  signals: '<rect x="11" y="1" width="18" height="38" rx="6" fill="none" stroke="currentColor" stroke-width="3"/><circle cx="20" cy="9" r="4" fill="currentColor"/><circle cx="20" cy="20" r="4" fill="currentColor"/><circle cx="20" cy="31" r="4" fill="currentColor"/>',
  stop: '<path d="M12 1h16l11 11v16L28 39H12L1 28V12z" fill="currentColor"/><rect x="9" y="17" width="22" height="6" fill="var(--panel)"/>',
  give_way: '<path d="M3 5h34L20 36z" fill="none" stroke="currentColor" stroke-width="5" stroke-linejoin="round"/>',
  near_first: '<path d="M20 3 38 35H2z" fill="none" stroke="currentColor" stroke-width="4" stroke-linejoin="round"/><path d="M15 18l10 12M25 18 15 30" stroke="currentColor" stroke-width="4"/>',
  oncoming_first: '<path d="M13 37V6m-8 9 8-9 8 9" fill="none" stroke="currentColor" stroke-width="3"/><path d="M29 3v32m-7-9 7 9 7-9" fill="none" stroke="currentColor" stroke-width="6"/>',
  priority: '<path d="M20 1 39 20 20 39 1 20z" fill="none" stroke="currentColor" stroke-width="4"/><path d="M20 10 30 20 20 30 10 20z" fill="currentColor"/>',
  open: '<circle cx="20" cy="20" r="16" fill="none" stroke="currentColor" stroke-width="3" stroke-dasharray="6 5"/>',
};

const plan = new Plan(element("canvas"));
const fixed = new URLSearchParams(location.search).get("at");
// The server's clock is ahead of the page's by at most so much, as was known at a time of the page.
const clock = { ahead: Infinity, at: 0 };
const own = { frame: null, at: 0, made: 0, level: "none", said: "", mark: null, over: false, sign: null, light: null, operator: false };

function put(id, text) {
  const found = element(id);
  if (found.textContent !== text) found.textContent = text;
}

// How long ago the frame was made, at most: a busy machine hands over frames that have waited.
function age() {
  return fixed !== null ? 0 : performance.now() / 1000 + clock.ahead - own.made;
}

async function compareClocks() {
  const asked = performance.now() / 1000;
  try {
    const { now_s } = await (await fetch("clock")).json();
    clock.ahead = Math.min(clock.ahead + DRIFT * (asked - clock.at), now_s - asked);
    clock.at = asked;
  } catch { /* the server is gone, and the frame ages */ }
}

// What threatens, as far as it is current; returns the level.
function band() {
  const frame = own.frame, age_s = age();
  const silent_s = (performance.now() - own.at) / 1000, late = !own.over && age_s > OLD_S;
  const grave = late || frame.alerts.some((one) => one.grave);
  const lapsed = frame.round_for_s !== null && age_s > frame.round_for_s;
  const level = grave || lapsed ? "none" : frame.level, danger = lapsed ? null : frame.danger;
  document.body.dataset.level = level;
  document.body.dataset.current = grave ? "no" : "yes";
  document.body.dataset.old = frame.round_old && level !== "none" ? "yes" : "no";
  put("level", grave ? "not current" : danger && !danger.hits ? "near miss" : WORDS[level]);
  if (grave || level === "none") {
    put("danger", grave ? "do not rely on this" : "no futures now");
    put("odds", "");
  } else {
    put("danger", danger ? danger.what : "no danger found");
    const left = frame.round_old ? `${(frame.round_age_s + age_s).toFixed(0)} s old` : danger && `${danger.in_s.toFixed(1)} s`;
    put("odds", [danger && danger.odds, left].filter(Boolean).join(" · "));
  }
  if (!late) alertOf(frame.alerts);
  else if (silent_s > OLD_S) alertOf([{ text: `the display's server does not answer: ${silent_s.toFixed(0)} s` }]);
  else alertOf([{ text: Number.isFinite(age_s) ? `this display is ${age_s.toFixed(0)} s behind` : "how old this is, is not known" }]);
  return level;
}

function show(frame, made) {
  own.frame = frame;
  own.at = performance.now();
  own.made = made;
  // Younger than now: one of the clocks stood still, as those of tablets do that sleep.
  if (age() < -0.1) { clock.ahead = Infinity; compareClocks(); }
  own.over = frame.alerts.some((one) => one.kind === "ended");
  document.body.dataset.twin = frame.twin_well ? "well" : "off";
  const level = band();
  const ahead = frame.ahead;
  put("arrival", ahead ? ahead.arrival : "–");
  element("arrival").className = ahead && ahead.in_s === null ? "word" : "";
  put("span", ahead ? [ahead.span, ahead.away_m === null ? "" : `${ahead.away_m.toFixed(0)} m`].filter(Boolean).join(" · ") : "");
  put("junction", ahead ? ahead.name : "no junction ahead");
  put("control-text", ahead ? [ahead.control, ahead.colour].filter(Boolean).join(" ") : "");
  const sign = ahead ? ahead.sign : null;
  if (sign !== own.sign) {
    element("sign").innerHTML = SIGNS[sign] ?? "";
    own.sign = sign;
  }
  put("speed-value", frame.speed_kmh === null ? "–" : Math.abs(frame.speed_kmh).toFixed(0));
  put("twin-text", frame.twin);
  put("twin-detail", frame.twin_detail);
  put("pace", frame.pace);
  put("virtual", frame.virtual);
  put("marks", frame.marks ? `${frame.marks}` : "");
  put("sentence", frame.sentence);
  flipOf(ahead ? ahead.light : null);
  notice(frame, level);
  plan.take(frame, own.at);
}

function alertOf(alerts) {
  element("alert").hidden = alerts.length === 0;
  const more = alerts.length > 1 ? ` (+${alerts.length - 1})` : "";
  put("alert-text", alerts.length ? alerts[0].text + more : "");
}

// Sound and speech: off until somebody asks for them.
const pressed = (id) => element(id).getAttribute("aria-pressed") === "true";
const say = (text) => { if (!speak(text)) toast("no voice on this machine"); };

function notice(frame, level) {
  const rises = LEVELS.indexOf(level) > LEVELS.indexOf(own.level) && level !== "calm";
  const alert = frame.alerts.length ? frame.alerts[0].kind : "";
  const news = [frame.ahead ? frame.ahead.name : "", rises ? level : "", alert].join("|");
  if (pressed("sound") && rises) beep(level === "danger" ? 3 : 1, level === "danger" ? 1400 : 900);
  if (pressed("sound") && alert && alert !== own.alert) beep(2, 500);
  if (pressed("speech") && (news !== own.said || rises)) say(alert ? frame.alerts[0].text : frame.sentence);
  own.level = level;
  own.said = news;
  own.alert = alert;
}

// Marks.
let noteTimer = 0, toastTimer = 0;

function toast(text) {
  put("toast", text);
  element("toast").hidden = false;
  clearTimeout(toastTimer);
  toastTimer = setTimeout(() => { element("toast").hidden = true; }, 3000);
}

async function post(what, body) {
  const options = { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) };
  const answer = await fetch(what, options);
  if (!answer.ok) throw new Error((await answer.text()).trim());
  return answer.json();
}

async function mark() {
  try {
    own.mark = await post("mark", {});
    toast(`marked at ${own.mark.drive_time_s.toFixed(1)} s`);
    element("note").hidden = false;
    element("note-text").value = "";
    closeNoteSoon();
  } catch (problem) { toast(`not marked: ${problem.message}`); }
}

function closeNoteSoon() {
  clearTimeout(noteTimer);
  noteTimer = setTimeout(() => { if (document.activeElement !== element("note-text")) closeNote(); }, NOTE_MS);
}

function closeNote() {
  element("note").hidden = true;
  element("note-text").blur();
}

element("note").addEventListener("submit", async (event) => {
  event.preventDefault();
  const note = element("note-text").value.trim();
  closeNote();
  if (!note || !own.mark) return;
  try {
    await post("mark", { note, mark_id: own.mark.mark_id, stamp_ns: own.mark.stamp_ns });
    toast("note kept");
  } catch (problem) { toast(`note not kept: ${problem.message}`); }
});

// Theme: as the system has it until a key says otherwise.
const light = matchMedia("(prefers-color-scheme: light)");
let chosen = null;

function theme() {
  const now = chosen ?? (light.matches ? "light" : "dark");
  document.documentElement.dataset.theme = now;
  element("theme").firstChild.textContent = now === "dark" ? "Light " : "Dark ";
  plan.recolour();
}
light.addEventListener("change", theme);

function toggle(id) {
  const on = !pressed(id);
  element(id).setAttribute("aria-pressed", `${on}`);
  if (id === "sound" && on) wake();
  if (id === "speech" && on && own.frame) say(own.frame.sentence);
}

// Roles.
function openRoles() {
  if (element("change").hidden || !own.frame) return;
  const list = element("roles-list"), vehicles = Object.entries(own.frame.roles);
  list.replaceChildren();
  const row = (name, key, values, now) => {
    const line = document.createElement("p"), title = document.createElement("b");
    title.textContent = name;
    line.append(title);
    for (const value of values) {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = value;
      button.setAttribute("aria-pressed", `${value === now}`);
      button.addEventListener("click", () => change(key, value, line));
      line.append(button);
    }
    list.append(line);
  };
  vehicles.forEach(([name, role], place) => {
    row(name, `role.${name}`, [...(place === 0 ? ["all"] : []), "twin", "shadow", "ghost"], role);
  });
  row("twins", "correction", ["free", "follow"], null);
  element("roles").showModal();
}

// The light ahead: red until it is given back.
function flipOf(light) {
  own.light = light;
  element("flip").hidden = !own.operator || !light;
  if (!light) return;
  element("flip").setAttribute("aria-pressed", `${light.why === "set"}`);
  put("flip-state", `${light.colour} (${light.why})`);
}

async function flip() {
  if (element("flip").hidden || !own.light) return;
  const key = `light.${own.light.group}`;
  try { toast((await post("change", { key, value: own.light.why === "set" ? "auto" : "red" })).text); } catch (problem) { toast(problem.message); }
}

async function change(key, value, line) {
  put("roles-said", `${key} = ${value} …`);
  try {
    put("roles-said", (await post("change", { key, value })).text);
    for (const button of line.querySelectorAll("button")) {
      button.setAttribute("aria-pressed", `${button.textContent === value}`);
    }
  } catch (problem) { put("roles-said", problem.message); }
}

const KEYS = {
  " ": mark, d: () => element("theme").click(), s: () => toggle("sound"), v: () => toggle("speech"),
  r: openRoles, l: flip, n: () => { if (!element("note").hidden) element("note-text").focus(); },
};
const typing = (event) => event.target.tagName === "INPUT" || element("roles").open;
document.addEventListener("keydown", (event) => {
  if (event.key === "Escape" && event.target.tagName === "INPUT") return closeNote();
  if (typing(event) || event.ctrlKey || event.metaKey || event.altKey) return;
  const wanted = KEYS[event.key.toLowerCase()];
  if (!wanted) return;
  event.preventDefault();
  if (!event.repeat) wanted();
});
document.addEventListener("keyup", (event) => { if (event.key === " " && !typing(event)) event.preventDefault(); });
element("mark").addEventListener("click", mark);
element("theme").addEventListener("click", () => {
  chosen = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
  theme();
});
element("sound").addEventListener("click", () => toggle("sound"));
element("speech").addEventListener("click", () => toggle("speech"));
element("change").addEventListener("click", openRoles);
element("flip").addEventListener("click", flip);

// Frames.
function listen() {
  const events = new EventSource("events"), begun = performance.now();
  events.onmessage = (event) => {
    show(JSON.parse(event.data), Number(event.lastEventId));
    document.body.dataset.ready = "yes";
    if (own.over) events.close();
    else if (age() > OLD_S && own.at - begun > AGAIN_MS) { events.close(); listen(); }
  };
}

async function begin() {
  theme();
  const about = await (await fetch("about")).json();
  put("attribution", about.attribution);
  own.operator = about.may_change;
  element("change").hidden = !own.operator;
  document.title = `foretwin co-pilot · ${about.run}`;
  if (fixed !== null) {
    show(await (await fetch(`frame?at=${encodeURIComponent(fixed)}`)).json(), 0);
    await plan.still();
    document.body.dataset.ready = "yes";
    return;
  }
  await compareClocks();
  listen();
  setInterval(() => { if (own.frame) band(); }, 250);
  setInterval(compareClocks, CLOCK_MS);
  plan.run();
}
begin();
