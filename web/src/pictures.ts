// The pictures. Browsers open at most six connections to a host, so the page requests the next frames of all views in one call, and repeats the
// request when they have arrived, so that no picture waits in a buffer. While frames are decoded, exactly one request for the next ones is in
// transit.

import { Encoding, type Frame, type View, type ViewImage } from "../gen/steradian/v1/view_pb.ts";
import type { Ages } from "./ages.ts";
import { now } from "./clock.ts";
import { make } from "./dom.ts";
import { type Wanted, nextFrames } from "./frames.ts";
import { type Flight, attach } from "./look.ts";
import { tellName } from "./names.ts";
import { notify } from "./notices.ts";
import { isExact } from "./projection.ts";
import { failureOf, messageOf, pause } from "./rpc.ts";
import type { Steering } from "./steering.ts";
import { Video } from "./video.ts";

/** Maximum number of views in a call. */
const MOST_VIEWS = 16;
/** Number of frames that the rate is computed from. */
const RATE_OF = 20;
/** Delay after a refused frame, such as without a headset. */
const REST_MS = 1000;

const TYPES: ReadonlyMap<Encoding, string> = new Map([
  [Encoding.JPEG, "image/jpeg"],
  [Encoding.PNG, "image/png"],
]);

/** A displayed view. */
class Picture {
  readonly figure = make("figure");
  #images = make("div", { class: "images" });
  #caption = make("figcaption");
  #canvases = new Map<string, HTMLCanvasElement>();
  #videos = new Map<string, Video>();
  #times: number[] = [];
  #gone = new AbortController();
  #last: Frame | undefined;
  #old = false;
  seen = 0n;
  /** H.264 sequence of its pictures; 0: request a key picture. */
  video = 0n;

  constructor(
    public view: View,
    private readonly steering: Steering,
    private readonly flight: Flight,
  ) {
    this.figure.dataset["view"] = view.name;
    this.figure.append(this.#images, this.#caption);
    this.change(view);
    this.fail(view.images.length > 0 ? "waiting for a picture" : "not connected");
  }

  /** Updates the images, for example when a headset connects, and the settings. */
  change(view: View): void {
    this.view = view;
    this.#images.dataset["type"] = view.type;
    this.#images.dataset["count"] = String(view.images.length);
    for (const image of view.images) {
      // A new geometry may change the aspect ratio.
      this.#canvas(image.part, image).style.setProperty("--aspect", String(image.width / image.height));
    }
    for (const [part, canvas] of this.#canvases) {
      if (view.images.some((image) => image.part === part)) continue;
      canvas.remove();
      this.#canvases.delete(part);
    }
  }

  #image(part: string): ViewImage | undefined {
    return this.view.images.find((image) => image.part === part);
  }

  #canvas(part: string, size: { width: number; height: number }): HTMLCanvasElement {
    const there = this.#canvases.get(part);
    if (there) return there;
    const { name } = this.view;
    const canvas = make("canvas", {
      width: size.width,
      height: size.height,
      tabindex: 0,
      role: "application",
      "aria-label": `View ${name}${part && `, ${part}`}: drag or arrow keys to look, W A S D Q E to fly, Z X to roll`,
      "data-part": part,
    });
    canvas.style.setProperty("--aspect", String(size.width / size.height));
    attach(canvas, () => this.#image(part), this.steering, this.flight, tellName, this.#gone.signal);
    this.#canvases.set(part, canvas);
    this.#images.append(canvas);
    return canvas;
  }

  /**
   * Longest side to request, or 0 for full size. The daemon reduces pictures by whole numbers: this requests the strongest reduction that has
   * at least as many pixels as the screen shows.
   */
  maxSize(): number {
    let least = Infinity;
    let longest = 0;
    for (const [part, canvas] of this.#canvases) {
      const image = this.#image(part);
      if (!image || canvas.clientWidth === 0) continue;
      least = Math.min(least, Math.floor(image.width / (canvas.clientWidth * devicePixelRatio)));
      longest = Math.max(longest, image.width, image.height);
    }
    return Number.isFinite(least) && least > 1 ? Math.ceil(longest / least) : 0;
  }

  /** Decodes and draws a frame. */
  async show(frame: Frame): Promise<void> {
    const bitmaps = await Promise.all(
      frame.images.map((image) => {
        if (image.encoding === Encoding.H264) return this.#video(image.part).decode(image);
        const type = TYPES.get(image.encoding);
        if (!type) throw new Error(`a picture in encoding ${image.encoding}, which was not asked for`);
        return createImageBitmap(new Blob([image.data as Uint8Array<ArrayBuffer>], { type }));
      }),
    );
    frame.images.forEach((image, index) => {
      const bitmap = bitmaps[index];
      if (!bitmap) return;
      const canvas = this.#canvas(image.part, image);
      if (canvas.width !== image.width || canvas.height !== image.height) {
        [canvas.width, canvas.height] = [image.width, image.height];
      }
      // Video pictures of an odd size have an extra column or row, which is cropped.
      canvas.getContext("2d", { alpha: false })?.drawImage(bitmap, 0, 0);
      bitmap.close();
    });
    this.figure.dataset["frame"] = String(frame.frameNumber);
    this.figure.dataset["encoding"] = Encoding[frame.images[0]?.encoding ?? 0];
    this.figure.dataset["camera"] = String(frame.cameraRevision);
    this.#times.push(now());
    if (this.#times.length > RATE_OF) this.#times.shift();
    this.#describe(frame);
  }

  /** Marks the picture as outdated, which has no frame rate. */
  mark(old: boolean): void {
    if (old === this.#old) return;
    this.#old = old;
    if (old) this.#times = [];
    if (this.#last) this.#describe(this.#last);
  }

  #describe(frame: Frame): void {
    this.#last = frame;
    const first = frame.images[0];
    const [from, to] = [this.#times[0], this.#times.at(-1)];
    const parts = [this.view.name];
    if (first) parts.push(`${first.width} × ${first.height}`);
    parts.push(`EV100 ${frame.exposureEv100.toFixed(1)}`);
    if (frame.limitingMagnitude !== undefined) parts.push(`stars to ${frame.limitingMagnitude.toFixed(1)} mag`);
    if (this.#old) parts.push("no new picture");
    else if (from !== undefined && to !== undefined && to > from) {
      parts.push(`${((1000 * (this.#times.length - 1)) / (to - from)).toFixed(1)} frames/s`);
    }
    if (frame.qualityLevel > 0) parts.push(`gives up: ${frame.givenUp.join(", ") || `level ${frame.qualityLevel}`}`);
    if (!this.view.images.every(isExact)) parts.push("drags are approximate");
    this.#caption.textContent = parts.join(" · ");
  }

  #video(part: string): Video {
    const there = this.#videos.get(part);
    if (there) return there;
    const video = new Video();
    this.#videos.set(part, video);
    return video;
  }

  /** Removes the view from the page. */
  close(): void {
    for (const video of this.#videos.values()) video.close();
    this.#gone.abort();
  }

  /** Displays why there is no frame. */
  fail(message: string): void {
    this.#caption.textContent = `${this.view.name} · ${message}`;
  }
}

export class Pictures extends EventTarget {
  #pictures = new Map<string, Picture>();
  #encoding = Encoding.JPEG;
  // Aborts the current call when the requested frames change.
  #changed = new AbortController();
  #resized = new ResizeObserver(() => this.#remeasure());
  #sizes = "";

  constructor(
    private readonly host: HTMLElement,
    private readonly steering: Steering,
    private readonly flight: Flight,
    private readonly ages: Ages,
  ) {
    super();
    this.#resized.observe(host);
    document.addEventListener("visibilitychange", () => this.#change());
  }

  get selected(): string[] {
    return [...this.#pictures.keys()];
  }

  /** Marks the pictures as outdated or current. */
  mark(old: boolean): void {
    for (const picture of this.#pictures.values()) picture.mark(old);
  }

  get encoding(): Encoding {
    return this.#encoding;
  }

  set encoding(encoding: Encoding) {
    this.#encoding = encoding;
    this.ages.forgetWays();
    this.#anew();
  }

  /** Displays these views, in this order; fires `select` if they have changed. */
  select(shown: View[]): void {
    const kept = new Map<string, Picture>();
    for (const view of shown.slice(0, MOST_VIEWS)) {
      const picture = this.#pictures.get(view.name) ?? new Picture(view, this.steering, this.flight);
      picture.change(view);
      kept.set(view.name, picture);
    }
    const change = [...kept.keys()].join() !== this.selected.join();
    for (const [name, picture] of this.#pictures) {
      if (kept.has(name)) continue;
      picture.close();
      this.ages.forget(name);
    }
    this.#pictures = kept;
    if (!change) return;
    this.host.replaceChildren(...[...kept.values()].map((picture) => picture.figure));
    this.host.dataset["count"] = String(kept.size);
    this.dispatchEvent(new Event("select"));
    this.#change();
  }

  /** Resets frame numbers, as after a restart of the daemon. */
  #anew(): void {
    for (const picture of this.#pictures.values()) picture.seen = picture.video = 0n;
    this.#change();
  }

  #change(): void {
    const before = this.#changed;
    this.#changed = new AbortController();
    before.abort();
  }

  // Request other sizes. The displayed pixels stay until these images arrive.
  #remeasure(): void {
    const sizes = [...this.#pictures.values()].map((picture) => picture.maxSize()).join();
    if (sizes === this.#sizes) return;
    this.#sizes = sizes;
    this.#anew();
  }

  #wanted(): Wanted[] {
    // A headset that is not connected has no images and no frames.
    const drawn = [...this.#pictures.values()].filter((picture) => picture.view.images.length > 0);
    return drawn.map((picture) => ({
      view: picture.view.name,
      encoding: this.#encoding,
      afterFrameNumber: picture.seen,
      video: picture.video,
      maxSize: picture.maxSize(),
    }));
  }

  /** Fetches pictures until the signal or an error that ends the session. */
  async run(session: AbortSignal): Promise<void> {
    this.#anew();
    let drawing = Promise.resolve();
    while (!session.aborted) {
      const signal = AbortSignal.any([session, this.#changed.signal]);
      const wanted = this.#wanted();
      // A background page fetches nothing, to save the daemon's time.
      if (wanted.length === 0 || document.hidden) {
        await pause(60_000, signal);
        continue;
      }
      try {
        const frames = await nextFrames(wanted, signal);
        const at = now();
        for (const frame of frames) {
          this.ages.arrived(frame, at);
          const picture = this.#pictures.get(frame.view);
          if (picture) [picture.seen, picture.video] = [frame.frameNumber, frame.video];
        }
        await drawing;
        drawing = this.#draw(frames);
      } catch (error) {
        switch (failureOf(error)) {
          case "ended":
            continue;
          case "unreachable":
          case "unknown":
            if (session.aborted) return;
            throw error;
          default:
            await this.#refused(wanted, error, signal);
        }
      }
    }
  }

  async #draw(frames: Frame[]): Promise<void> {
    await Promise.all(
      frames.map(async (frame) => {
        const picture = this.#pictures.get(frame.view);
        if (!picture) return;
        try {
          await picture.show(frame);
          this.ages.shown(frame);
          this.dispatchEvent(new CustomEvent("frame", { detail: frame }));
        } catch (error) {
          picture.video = 0n;
          picture.fail(`the picture cannot be decoded: ${error}`);
        }
      }),
    );
  }

  // The daemon can be reached and reports a reason. The views may have changed, so reload them.
  async #refused(wanted: Wanted[], error: unknown, signal: AbortSignal): Promise<void> {
    const message = messageOf(error);
    for (const { view } of wanted) this.#pictures.get(view)?.fail(message);
    notify(`Pictures: ${message}`, "error");
    this.dispatchEvent(new Event("refused"));
    await pause(REST_MS, signal);
  }
}
