// The page: a session with the daemon, which restarts whenever it is lost, and the panels around it.

import { Code, ConnectError } from "@connectrpc/connect";

import { Encoding, type Frame } from "../gen/steradian/v1/view_pb.ts";
import { Ages } from "./ages.ts";
import { Clock } from "./clock.ts";
import { byId, duration, make } from "./dom.ts";
import { askForToken } from "./login.ts";
import { Flight } from "./look.ts";
import { Model } from "./model.ts";
import { hideBanner, notify, showBanner } from "./notices.ts";
import { bodiesPanel } from "./panel_bodies.ts";
import { cameraPanel } from "./panel_camera.ts";
import { checksPanel } from "./panel_checks.ts";
import { exposurePanel } from "./panel_exposure.ts";
import { findPanel } from "./panel_find.ts";
import { placePanel } from "./panel_place.ts";
import { scenePanel } from "./panel_scene.ts";
import { snapshotsPanel } from "./panel_snapshots.ts";
import { Statistics } from "./panel_stats.ts";
import { viewsPanel } from "./panel_views.ts";
import { Pictures } from "./pictures.ts";
import { failureOf, messageOf, pause } from "./rpc.ts";
import { Steering } from "./steering.ts";
import { tabs } from "./tabs.ts";
import { decodesVideo } from "./video.ts";

/** Delays between attempts to reach the daemon, each twice the previous one. */
const [FIRST_WAIT_MS, LONGEST_WAIT_MS] = [500, 4000];
/** Interval at which views are read while none is displayed. */
const NO_PICTURE_MS = 3000;
/** Interval at which the displayed ages are updated. */
const AGE_INTERVAL_MS = 200;
/** A daemon sends statistics every second. If none arrive for this time, it is reported as silent. */
const SILENT_MS = 3500;
/** After this time, the page reconnects. */
const LOST_MS = 12_000;
/** An older picture is marked as outdated, because the daemon sends at least one per second. */
const OLD_MS = 3000;

const clock = new Clock();
const ages = new Ages(clock);
const steering = new Steering(clock);
const flight = new Flight(steering);
const model = new Model();
const pictures = new Pictures(byId("pictures"), steering, flight, ages);

tabs(byId("tabs"));
cameraPanel(byId("panel-camera"), steering, flight);
findPanel(byId("panel-camera"), steering, flight);
exposurePanel(byId("panel-exposure"), model, pictures);
viewsPanel(byId("panel-views"), model);
scenePanel(byId("panel-scene"), model);
placePanel(byId("panel-scene"), model);
snapshotsPanel(byId("panel-scene"), model);
bodiesPanel(byId("panel-bodies"), model);
const statistics = new Statistics(model, clock, ages, byId("panel-statistics"), byId("panel-headset"));
checksPanel(byId("panel-checks"));

model.addEventListener("loaded", () => {
  steering.mayMove = model.info?.role !== "view";
});
pictures.addEventListener("frame", (event) => {
  const frame = (event as CustomEvent<Frame>).detail;
  if (frame.camera && frame.view !== headsetView()) steering.observe(frame.camera);
  model.observe(frame);
});
pictures.addEventListener("refused", () => void model.refresh());
statistics.addEventListener("headset", () => void model.refresh());

/** Frames of the headset contain the origin of its room, with a camera revision that may be newer than that of other frames. */
const headsetView = (): string | undefined => model.views.find(({ type }) => type === "headset")?.name;

// The page's address contains the names of the displayed views, so that an address can configure a screen of a control room.
const choice = byId("views");
const namesInAddress = (): string[] => new URLSearchParams(location.hash.slice(1)).get("views")?.split(",").filter(Boolean) ?? [];

function showViews(names: string[]): void {
  const shown = model.views.filter(({ name }) => names.includes(name));
  for (const box of choice.querySelectorAll("input")) box.checked = names.includes(box.value);
  pictures.select(shown);
  byId("empty").hidden = shown.length > 0;
}

function listViews(): void {
  const names = model.views.map(({ name }) => name);
  const boxes = [...choice.querySelectorAll("input")];
  if (names.join() !== boxes.map(({ value }) => value).join()) {
    choice.replaceChildren(
      ...model.views.map(({ name, type }) => {
        const box = make("input", { type: "checkbox", name: "view", value: name });
        box.addEventListener("change", () => {
          const wanted = [...choice.querySelectorAll("input")].filter(({ checked }) => checked).map(({ value }) => value);
          history.replaceState(null, "", `#views=${wanted.join(",")}`);
          showViews(wanted);
        });
        return make("label", { class: "chip", title: type.replace("_", " ") }, box, make("span", { text: name }));
      }),
    );
  }
  const wanted = namesInAddress().filter((name) => names.includes(name));
  const none = location.hash === "#views=";
  showViews(wanted.length > 0 || none ? wanted : names.slice(0, 1));
}
model.addEventListener("change", listViews);
// Frames report new revisions of the scene. While the page displays no pictures, it polls for views that other clients create.
setInterval(() => {
  const isLost = document.documentElement.classList.contains("lost");
  if (model.scene && pictures.selected.length === 0 && !document.hidden && !isLost) void model.refresh();
}, NO_PICTURE_MS);
addEventListener("hashchange", listViews);

const encoding = byId("encoding") as HTMLSelectElement;
const ENCODINGS: ReadonlyMap<string, Encoding> = new Map([
  ["h264", Encoding.H264],
  ["jpeg", Encoding.JPEG],
  ["png", Encoding.PNG],
]);
function encode(): void {
  pictures.encoding = ENCODINGS.get(encoding.value) ?? Encoding.JPEG;
}
encoding.addEventListener("change", encode);
// Use video if the browser has a decoder. This is determined before the first picture is requested.
const video = decodesVideo().then((decodes) => {
  if (!decodes) encoding.querySelector("option[value=h264]")?.remove();
  encode();
});

// Red light preserves dark adaptation.
const NIGHT = "steradian.night";
const night = byId("night");
function setNight(on: boolean): void {
  document.documentElement.classList.toggle("night", on);
  night.setAttribute("aria-pressed", String(on));
}
night.addEventListener("click", () => {
  const on = night.getAttribute("aria-pressed") !== "true";
  setNight(on);
  localStorage.setItem(NIGHT, on ? "on" : "off");
});
setNight(localStorage.getItem(NIGHT) === "on");

const age = byId("age");
setInterval(() => {
  const picture = ages.picture();
  const pose = ages.pose();
  const old = picture !== undefined && picture > OLD_MS;
  age.classList.toggle("old", old);
  pictures.mark(old);
  watchSilence();
  if (document.documentElement.classList.contains("lost")) age.textContent = "no connection";
  else if (picture === undefined) age.textContent = "no picture";
  else {
    const camera = pose === undefined ? "" : ` · camera to screen ${duration(pose)}`;
    // The clock offset has an error, so a negative age is displayed as zero.
    age.textContent = `picture ${duration(Math.max(0, picture))} old${camera}`;
    age.dataset["ms"] = picture.toFixed(1);
  }
}, AGE_INTERVAL_MS);

// The connections to a daemon that is stopped, or whose cable is cut, stay open, but nothing arrives.
let isSilent = false;
let live = new AbortController();
function watchSilence(): void {
  const silence = statistics.silence() ?? 0;
  if (silence > LOST_MS) live.abort();
  if (silence <= SILENT_MS) {
    if (isSilent) hideBanner();
    isSilent = false;
    return;
  }
  isSilent = true;
  const text = `It has not answered for ${Math.floor(silence / 1000)} s. Pictures and figures are from before.`;
  showBanner(`No answer from the daemon at ${location.host}`, text);
}

/** Runs one session: reads scene and views, then follows pictures and statistics until one of them fails. */
async function session(loaded: () => void): Promise<void> {
  const end = new AbortController();
  live = new AbortController();
  const silent = new Promise<never>((_, reject) => {
    live.signal.addEventListener("abort", () => reject(new ConnectError("It does not answer", Code.Unavailable)));
  });
  clock.reset();
  ages.reset();
  try {
    await Promise.all([model.load(end.signal), steering.load(end.signal)]);
    loaded();
    await Promise.race([pictures.run(end.signal), statistics.run(end.signal), silent]);
    throw new Error("The daemon is shutting down");
  } finally {
    end.abort();
    isSilent = false;
  }
}

let retry = new AbortController();
byId("banner-retry").addEventListener("click", () => {
  retry.abort();
  if (isSilent) live.abort();
});

async function run(): Promise<never> {
  let wait = FIRST_WAIT_MS;
  let hasRun = false;
  for (;;) {
    try {
      await session(() => {
        if (hasRun && document.documentElement.classList.contains("lost")) notify("The daemon is back.");
        hasRun = true;
        document.documentElement.classList.remove("lost");
        hideBanner();
        wait = FIRST_WAIT_MS;
      });
    } catch (error) {
      document.documentElement.classList.add("lost");
      if (failureOf(error) === "unknown") {
        hideBanner();
        await askForToken(messageOf(error));
        continue;
      }
      const unreachable = failureOf(error) === "unreachable";
      const title = unreachable ? `No connection to the daemon at ${location.host}` : "The daemon has refused";
      retry = new AbortController();
      // Use random delays, so that pages that have lost the same daemon do not all retry at once.
      const rest = wait * (0.75 + 0.5 * Math.random());
      const until = Date.now() + rest;
      const showCountdown = () => {
        const seconds = Math.max(0, Math.ceil((until - Date.now()) / 1000));
        showBanner(title, `${messageOf(error)}. Pictures and figures are from before. Trying again in ${seconds} s.`);
      };
      showCountdown();
      const ticking = setInterval(showCountdown, 500);
      await pause(rest, retry.signal);
      clearInterval(ticking);
      wait = Math.min(2 * wait, LONGEST_WAIT_MS);
    }
  }
}

void video.then(run);
