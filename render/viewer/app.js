// The page of a live session: what comes is shown, what is changed is sent.

import { Connection } from "./connection.js";
import { Controls } from "./controls.js";
import { LightMap } from "./map.js";
import { Orbit } from "./orbit.js";
import { showImage } from "./panels.js";
import { Sources } from "./sources.js";
import { Strip } from "./strip.js";

const byId = (id) => document.getElementById(id);
const STATES = {
  starting: "starting",
  running: "live",
  away: "camera away",
  "no-camera": "no camera",
  calibration: "no calibration",
  clipped: "all clipped",
  dark: "no light",
  ended: "ended",
  lost: "no connection",
};
const STALE = new Set(["away", "no-camera", "calibration", "ended", "lost"]);
const TOAST_MS = 6000;

const connection = new Connection(onMoment, onLost);
const send = (changes) => connection.set(changes);
const controls = new Controls(byId("controls"), send);
const orbit = new Orbit(byId("picture"), send);
const lightMap = new LightMap(byId("map"), byId("tip"));
const sources = new Sources(byId("blend"), byId("sources"));
const strip = new Strip(byId("times"), byId("stages"), byId("counters"));
let settings = null;
let noticeNumber = null;
let toastTimer = null;

function onMoment(header, images) {
  settings = header.settings;
  showState(header.state.name, header.state.message);
  showImage("camera", images.camera);
  showImage("picture", images.picture);
  if (images.map) byId("map-panel").classList.add("has-image");
  lightMap.show(images.map, header.lights);
  showVitals(header);
  strip.show(header);
  sources.show(header.account.sources, STATES);
  controls.follow(header);
  orbit.follow(settings);
  byId("draft").hidden = !(header.is_draft && images.picture);
  byId("freeze").setAttribute("aria-pressed", settings.is_frozen);
  byId("record").setAttribute("aria-pressed", header.is_recording);
  showNotice(header.notice);
  document.body.dataset.number = header.number;
  document.body.dataset.shown = Number(document.body.dataset.shown ?? 0) + 1;
}

function onLost(code, reason) {
  if (document.body.dataset.state === "ended") return; // that is why
  const why = { 1013: "Too many pages watch this session.", 1008: `The session closed the connection: ${reason}.` }[code];
  showState("lost", why ?? "No connection to the session; trying again. If it was started anew, open the address it printed.");
}

function showState(name, message) {
  document.body.dataset.state = name;
  byId("chip-text").textContent = STATES[name] ?? name;
  byId("banner").hidden = !message;
  if (byId("banner").textContent !== message) byId("banner").textContent = message;
  document.querySelector(".panels").classList.toggle("stale", STALE.has(name));
}

function showVitals({ account, lights, state, age_s: age }) {
  byId("source").textContent = account.source ?? "";
  byId("rate").textContent = account.frame_rate_hz?.toFixed(1) ?? "–";
  byId("pace").hidden = !account.pace;
  byId("pace").textContent = account.pace ? `Drawn for it: ${account.pace}` : "";
  const latency = account.latency_ms;
  byId("latency").textContent = STALE.has(state.name) && latency != null ? `${age.toFixed(1)} s old`
    : latency == null ? "–" : latency < 1000 ? `${Math.round(latency)} ms` : `${(latency / 1000).toFixed(1)} s`;
  byId("camera-size").textContent = account.size_px ? `${account.size_px[0]}×${account.size_px[1]} px` : "";
  if (!lights) return;
  const lit = lights.irradiance.filter((rgb) => rgb.some((value) => value > 0)).length;
  const keys = lights.is_key.filter(Boolean).length;
  byId("count-now").textContent = lit;
  const inKeys = sumOf(lights.irradiance.filter((_, index) => lights.is_key[index]));
  const inLights = sumOf(lights.irradiance);
  const share = (part) => `${Math.round(100 * part)} %`;
  const lightShare = 1 - lights.fill_share;
  const keyShare = inLights > 0 ? (lightShare * inKeys) / inLights : 0;
  byId("fill").textContent =
    `key lights ${keys}, ${share(keyShare)} of the light · smooth fill ${share(lights.fill_share)}`;
}

function sumOf(colours) {
  return colours.flat().reduce((sum, value) => sum + value, 0);
}

function showNotice(notice) {
  const isFirst = noticeNumber === null; // a notice from before this page was opened
  if (notice && notice.number !== noticeNumber && !isFirst) toast(notice.text, notice.is_error);
  noticeNumber = notice?.number ?? 0;
}

function toast(text, isError) {
  const element = byId("toast");
  element.textContent = text;
  element.classList.toggle("error", isError);
  element.hidden = false;
  clearTimeout(toastTimer);
  toastTimer = setTimeout(() => { element.hidden = true; }, TOAST_MS);
}

byId("freeze").addEventListener("click", () => send({ is_frozen: !settings?.is_frozen }));
byId("snapshot").addEventListener("click", () => connection.ask("snapshot"));
byId("record").addEventListener("click", () => connection.ask("record"));
byId("export").addEventListener("click", () => connection.ask(byId("format").value));
byId("reset-view").addEventListener("click", () => orbit.reset());
document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches("input, select, textarea")) return;
  const id = { f: "freeze", s: "snapshot", r: "record" }[event.key.toLowerCase()];
  if (id) byId(id).click();
});

function applyTheme(theme) {
  document.documentElement.dataset.theme = theme;
}
const systemTheme = matchMedia("(prefers-color-scheme: light)").matches ? "light" : "dark";
applyTheme(localStorage.getItem("theme") ?? systemTheme);
byId("theme").addEventListener("click", () => {
  const theme = document.documentElement.dataset.theme === "light" ? "dark" : "light";
  localStorage.setItem("theme", theme);
  applyTheme(theme);
});
