// The age of displayed pictures. Two values: from the end of rendering to the screen, and from the arrival of a pose at
// the daemon to the screen, which is known for the first picture of each pose.

import type { Frame } from "../gen/steradian/v1/view_pb.ts";
import { type Clock, milliseconds, now } from "./clock.ts";

/** Number of poses that median and 99th percentile are computed from. */
const MOST = 200;

export interface Quantiles {
  median: number;
  p99: number;
}

/** Latency of a pose, ms: to the end of rendering, to the browser (encoding, connection), to the screen (decoding); and the sum. */
interface Way {
  rendered: number;
  sent: number;
  drawn: number;
  whole: number;
}

export type Ways = { [part in keyof Way]: Quantiles } & { count: number };

export class Ages {
  #clock: Clock;
  #rendered = new Map<string, number>();
  #revision = new Map<string, bigint>();
  #ways: Way[] = [];
  #arrived = new WeakMap<Frame, number>();
  /** Age of the last picture when it was drawn, ms. */
  last: number | undefined;

  constructor(clock: Clock) {
    this.#clock = clock;
  }

  reset(): void {
    this.#rendered.clear();
    this.#revision.clear();
    this.last = undefined;
  }

  /** Removes the data of a view, because a hidden view has no age. */
  forget(view: string): void {
    this.#rendered.delete(view);
    this.#revision.delete(view);
  }

  /** Records the arrival of a frame. */
  arrived(frame: Frame, at: number): void {
    this.#arrived.set(frame, at);
    if (frame.renderTime) this.#clock.arrived(milliseconds(frame.renderTime), at);
    if (frame.poseTime) this.#clock.poseShown(frame.cameraRevision, milliseconds(frame.poseTime));
  }

  /** Records that a frame was drawn. */
  shown(frame: Frame): void {
    const offset = this.#clock.offset()?.offset;
    const at = now();
    if (frame.renderTime) {
      const rendered = milliseconds(frame.renderTime);
      this.#rendered.set(frame.view, rendered);
      if (offset !== undefined) this.last = at + offset - rendered;
    }
    const before = this.#revision.get(frame.view);
    this.#revision.set(frame.view, frame.cameraRevision);
    const arrived = this.#arrived.get(frame);
    if (before === undefined || before === frame.cameraRevision || !frame.poseTime || !frame.renderTime) return;
    if (offset === undefined || arrived === undefined) return;
    const [pose, rendered] = [milliseconds(frame.poseTime), milliseconds(frame.renderTime)];
    this.#ways.push({ rendered: rendered - pose, sent: arrived + offset - rendered, drawn: at - arrived, whole: at + offset - pose });
    if (this.#ways.length > MOST) this.#ways.shift();
  }

  /** Age of the oldest picture on the screen, ms; undefined if there is no picture or the clock offset is unknown. */
  picture(): number | undefined {
    const offset = this.#clock.offset()?.offset;
    if (offset === undefined || this.#rendered.size === 0) return undefined;
    return now() + offset - Math.min(...this.#rendered.values());
  }

  /** Latency of the last pose, ms. */
  pose(): number | undefined {
    return this.#ways.at(-1)?.whole;
  }

  /** Latencies of the last poses. */
  ways(): Ways | undefined {
    const count = this.#ways.length;
    if (count === 0) return undefined;
    const of = (part: keyof Way): Quantiles => {
      const sorted = this.#ways.map((way) => way[part]).sort((a, b) => a - b);
      const at = (share: number) => sorted[Math.min(count - 1, Math.floor(share * count))] ?? Number.NaN;
      return { median: at(0.5), p99: at(0.99) };
    };
    return { rendered: of("rendered"), sent: of("sent"), drawn: of("drawn"), whole: of("whole"), count };
  }

  /** Forgets the poses, because those of another encoding are not comparable. */
  forgetWays(): void {
    this.#ways = [];
  }
}
