"use strict";

const at = (id) => document.getElementById(id);
const oldS = 1;            // an image or a loop that is older is said to be old
const patienceMs = 3000;   // for an answer

let clock = null;  // how far lapservo's is ahead of this page's, by the quickest answer of late
let number = 0, pictureCameMs = null, heardMs = null, last = null, failed = 0;

const wait = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
const text = (element, value) => { if (element.textContent !== value) element.textContent = value; };

async function ask(path, options = {}, ms = patienceMs) {
  return fetch(path, { ...options, cache: "no-store", signal: AbortSignal.timeout(ms) });
}

// By the end of a number's name: its unit here, how many of them, and decimals. Angles are in rad as in files.
const units = { rad: ["rad", 1, 4], m: ["mm", 1000, 2], px: ["px", 1, 1] };
const unit = (name) => units[name.slice(name.lastIndexOf("_") + 1)];

function shown(name, value) {
  if (value === null || value === undefined) return "–";
  const [, factor, digits] = unit(name);
  return (factor * value).toFixed(digits).replace(/^-(0\.0*)$/, "$1");
}
function sigmaShown(name, sigma) {
  return Number((unit(name)[1] * sigma).toPrecision(2)).toString();
}
function label(name) {
  return `${name.slice(0, name.lastIndexOf("_"))} [${unit(name)[0]}]`;
}

function row(cells) {
  const tr = document.createElement("tr");
  cells.forEach((cell, i) => {
    const td = document.createElement(i ? "td" : "th");
    if (!i) td.scope = "row";
    td.textContent = cell;
    tr.append(td);
  });
  return tr;
}

function instrumentTable(seen) {
  const table = document.createElement("table");
  table.createCaption().textContent = `${seen.name}: ${seen.status}`;
  const body = table.createTBody();
  for (const [name, one] of Object.entries({ ...(seen.q || {}), ...(seen.tau_rad ? { tau_rad: seen.tau_rad } : {}) }))
    body.append(row([label(name), shown(name, one.value), "± " + sigmaShown(name, one.sigma)]));
  for (const [name, value] of Object.entries(last.loop ? {} : seen.features || {}))
    body.append(row([label(name), shown(name, value), ""]));
  return table;
}

function showLoop(state) {
  const loop = state.loop;
  at("features").hidden = at("log").hidden = !loop;
  if (!loop) return;
  at("features").tBodies[0].replaceChildren(...loop.features.map((f) =>
    row([label(f.name), shown(f.name, f.measured), shown(f.name, f.desired), shown(f.name, f.error)])));
  at("events").replaceChildren(...state.events.map((event) => {
    const li = document.createElement("li");
    li.textContent = `${event.time_s.toFixed(2)} s  ${event.state}`;
    return li;
  }));
}

function showState(state) {
  last = state;
  text(at("title"), `lapservo ${state.title}`);
  at("start").disabled = !state.may_start || (state.loop !== null && !state.loop.can_start);
  at("hold").disabled = !state.has_loop;
  at("hold").hidden = !state.has_loop;
  at("start").hidden = !state.has_loop || state.has_run_button;
  at("run").hidden = !state.has_run_button;
  if (!at("note").dataset.said)
    text(at("note"), !state.has_loop ? "" : !state.may_start ? "Start needs lapservo servo --enable-motion." : at("start").disabled ? "Start needs an arm that is ready." : "");
  showLoop(state);
  showAnswer(state.loop);
  at("instruments").replaceChildren(...state.instruments.map(instrumentTable));
}

function compareClocks(nowS, beginMs) {
  const tookMs = performance.now() - beginMs;
  if (!clock || tookMs < clock.tookMs || performance.now() > clock.untilMs)
    clock = { tookMs, aheadMs: 1000 * nowS - (beginMs + tookMs / 2), untilMs: performance.now() + 10000 };
}

// The display uses this page's clock too: nothing old looks new where the connection is lost.
function showAges() {
  const now = performance.now();
  const silentS = heardMs === null ? null : (now - heardMs) / 1000;
  const lost = silentS === null || silentS > 2 || failed > 2;
  at("buttons").hidden = lost || last.ended;
  if (at("buttons").hidden) release(), choose(null);
  at("alert").hidden = !lost || heardMs === null;
  if (!at("alert").hidden) text(at("alert"), `No answer for ${Math.round(silentS)} s: lapservo has ended, or the network is gone. What you see is old.`);
  const ageS = pictureCameMs === null ? null : (now - pictureCameMs) / 1000;
  const old = ageS !== null && ageS > oldS && last && last.live;
  at("picture").classList.toggle("old", lost || ageS === null || old);
  const parts = [ageS === null ? "no image yet" : last && !last.live ? "a recording" : `image ${old ? "OLD: " + ageS.toFixed(1) + " s" : (1000 * ageS).toFixed(0) + " ms"}`];
  if (last && last.loop) parts.push(`loop's delay ${(1000 * last.loop.delay_s).toFixed(0)} ms`);
  if (last && last.loop && last.loop.limited) parts.push("at a limit");
  text(at("ages"), parts.join(" · "));
  const state = at("state");
  if (lost) {
    text(state, heardMs === null ? "connecting" : "not connected");
    state.className = "";
  } else if (!last.loop) {
    const found = last.instruments.filter((one) => one.status === "ok").length;
    text(state, (last.ended ? "ended: " : "") + (last.images ? `${found} of ${last.instruments.length} seen` : "no image yet"));
    state.className = !last.ended && found && found === last.instruments.length ? "track" : "";
  } else {
    const current = last.events.length ? last.events[0].state : "";
    const asleep = last.loop_age_s > oldS;
    text(state, asleep ? `the loop is silent for ${last.loop_age_s.toFixed(0)} s` : current + (last.asked ? ` (${last.asked} requested)` : ""));
    state.className = asleep || current.startsWith("hold") || current.startsWith("end") ? "hold" : current === "track" ? "track" : "";
  }
}

async function pictures() {
  for (;;) {
    try {
      const answer = await ask(`picture?after=${number}`);
      if (answer.status === 200) {
        const got = Number(answer.headers.get("X-Number"));
        const cameMs = 1000 * Number(answer.headers.get("X-Came-S"));
        const url = URL.createObjectURL(await answer.blob());
        const before = at("picture").src;
        at("picture").src = url;
        if (before.startsWith("blob:")) URL.revokeObjectURL(before);
        number = got;
        pictureCameMs = clock ? cameMs - clock.aheadMs : performance.now();
        showAges();
      } else if (answer.status !== 204) {
        await wait(1000);
      }
    } catch {
      await wait(500);
    }
    if (document.hidden) await wait(500);
  }
}

async function states() {
  for (;;) {
    try {
      const begin = performance.now();
      const answer = await ask("state");
      if (answer.ok) {
        const state = await answer.json();
        heardMs = performance.now();
        failed = 0;
        compareClocks(state.now_s, begin);
        showState(state);
      }
    } catch {
      ++failed;  // showAges() says it
    }
    await wait(150);
  }
}

// lapservo's clock, by no way ahead of it: a start seems rather too old than too new.
function serverNowS() {
  return ((performance.now() + clock.aheadMs - clock.tookMs / 2) / 1000).toFixed(4);
}

async function command(name, path = name === "start" ? `start?at=${serverNowS()}` : name) {
  at("start").blur();
  const note = at("note");
  note.dataset.said = "yes";
  text(note, `${name} …`);
  try {
    const answer = await ask(path, { method: "POST" });
    text(note, `${name}: ${(await answer.text()).trim()}`);
  } catch {
    text(note, `${name}: no answer, it may have arrived`);
  }
}

for (const name of ["hold", "start", "stop"]) at(name).addEventListener("click", () => command(name));
// One key holds, from anywhere and under any layout; none starts but Enter or Space on Start, which keeps the focus from
// Tab to the next command only, and gets none by the mouse: a key pressed by mistake moves nothing.
at("start").addEventListener("mousedown", (event) => event.preventDefault());
document.addEventListener("keydown", (event) => {
  const isH = event.code === "KeyH" || event.key.toLowerCase() === "h";
  if (!isH || event.ctrlKey || event.altKey || event.metaKey || event.repeat) return;
  if (!at("hold").disabled) command("hold");
});

// Shift and a click name a place for the tip; nothing is sent before it is confirmed, and nothing moves that is held.
let target = null, answered = "";

function choose(pixel, place) {
  target = pixel;
  at("tip").hidden = at("target").hidden = !target;
  if (target) Object.assign(at("target").style, place);
}

at("picture").addEventListener("click", (event) => {
  if (!event.shiftKey || !last || !last.takes_tip_goals || at("buttons").hidden) return;
  const picture = at("picture"), x = event.offsetX / picture.clientWidth, y = event.offsetY / picture.clientHeight;
  choose({ u: x * picture.naturalWidth - 0.5, v: y * picture.naturalHeight - 0.5, image: number }, { left: `${100 * x}%`, top: `${100 * y}%` });
});
at("move").addEventListener("click", () => {
  const { u, v, image } = target;
  choose(null);
  answered = last.loop ? last.loop.answer : "";
  command("tip", `tip?u=${u.toFixed(1)}&v=${v.toFixed(1)}&image=${image}&at=${serverNowS()}`);
});
at("cancel").addEventListener("click", () => choose(null));

function showAnswer(loop) {
  if (!loop || loop.answer === answered) return;
  answered = loop.answer;
  at("note").dataset.said = "yes";
  text(at("note"), `tip: ${answered}`);
}

// The run button: while it is pressed the page says so, again and again. After 0.2 s without a word lapservo takes it
// for released. A press also starts, where this page may.
const sayMs = 50, sayPatienceMs = 150;
let pressed = false;

async function sayPressed() {
  try {
    const answer = await ask(`press?at=${serverNowS()}`, { method: "POST" }, sayPatienceMs);
    if (!answer.ok) text(at("note"), `run: ${(await answer.text()).trim()}`);
    return answer.ok;
  } catch {
    return false;  // showAges() says it
  }
}

async function press() {
  if (pressed) return;
  pressed = true;
  at("run").setAttribute("aria-pressed", "true");
  let started = !last.has_loop || !last.may_start;
  while (pressed) {
    const begin = performance.now();
    const heard = await sayPressed();
    if (heard && pressed && !started) {
      started = true;
      command("start");
    }
    await wait(Math.max(0, begin + sayMs - performance.now()));
  }
}

function release() {
  if (!pressed) return;
  pressed = false;
  at("run").setAttribute("aria-pressed", "false");
  fetch("release", { method: "POST", keepalive: true }).catch(() => {});
}

const isPressKey = (event) => event.key === " " || event.key === "Enter";
at("run").addEventListener("pointerdown", (event) => {
  if (event.button !== 0) return;
  if (event.target.hasPointerCapture(event.pointerId)) event.target.releasePointerCapture(event.pointerId);  // a finger that slides off lets go
  press();
});
at("run").addEventListener("keydown", (event) => {
  if (!isPressKey(event)) return;
  event.preventDefault();
  if (!event.repeat) press();
});
at("run").addEventListener("keyup", (event) => { if (isPressKey(event)) release(); });
at("run").addEventListener("contextmenu", (event) => event.preventDefault());  // of a long press
for (const name of ["pointerleave", "pointerup", "pointercancel", "blur"]) at("run").addEventListener(name, release);
for (const name of ["pointerup", "blur", "pagehide"]) addEventListener(name, release);
document.addEventListener("visibilitychange", release);

setInterval(showAges, 100);
pictures();
states();
