// Estimates the offset between the clocks of daemon and browser. Messages bound it: a time that the daemon stamps
// between a request and its answer lies between the browser's times of these two events. The estimate is the middle of
// the narrowest bounds.

import type { Timestamp } from "@bufbuild/protobuf/wkt";

/** Clocks drift: bounds older than this are dropped when new ones exist. */
const MEMORY_MS = 600_000;
/** Maximum number of poses that are tracked at a time. */
const MOST_POSES = 64;

/** Milliseconds since 1970 by the clock of the browser. */
export const now = (): number => performance.timeOrigin + performance.now();

/** A time stamp of the daemon, milliseconds since 1970. */
export const milliseconds = ({ seconds, nanos }: Timestamp): number => Number(seconds) * 1000 + nanos / 1e6;

interface Bound {
  value: number;
  at: number;
}

export class Clock {
  #lower: Bound = { value: -Infinity, at: -Infinity };
  #upper: Bound = { value: Infinity, at: -Infinity };
  #sent = new Map<bigint, number>();

  /** Drops all bounds: a new daemon may have another clock. */
  reset(): void {
    this.#lower = { value: -Infinity, at: -Infinity };
    this.#upper = { value: Infinity, at: -Infinity };
    this.#sent.clear();
  }

  /** Records a stamp of the daemon that has just arrived. */
  arrived(stamp: number, at = now()): void {
    const value = stamp - at;
    if (value > this.#lower.value || at - this.#lower.at > MEMORY_MS) this.#lower = { value, at };
    this.#agree();
  }

  /** Records a stamp that the daemon made after a request of the browser. */
  stampedAfter(stamp: number, asked: number): void {
    const value = stamp - asked;
    if (value < this.#upper.value || asked - this.#upper.at > MEMORY_MS) this.#upper = { value, at: asked };
    this.#agree();
  }

  /** Records that a pose was sent; the answer contains its revision. */
  poseSent(revision: bigint, at: number): void {
    this.#sent.set(revision, at);
    const oldest = this.#sent.keys().next();
    if (this.#sent.size > MOST_POSES && !oldest.done) this.#sent.delete(oldest.value);
  }

  /** Records the time at which the pose of a frame arrived. If this page sent the pose, it arrived after it was sent. */
  poseShown(revision: bigint, poseTime: number): void {
    const sent = this.#sent.get(revision);
    if (sent !== undefined) this.stampedAfter(poseTime, sent);
  }

  // After a clock was set, old bounds contradict new ones, so only the newer bounds count.
  #agree(): void {
    if (this.#lower.value <= this.#upper.value) return;
    if (this.#lower.at > this.#upper.at) this.#upper = { value: this.#lower.value, at: this.#lower.at };
    else this.#lower = { value: this.#upper.value, at: this.#upper.at };
  }

  /** Time of the daemon minus time of the browser, and its maximum error, both ms; undefined while unknown. */
  offset(): { offset: number; error: number } | undefined {
    const [lower, upper] = [this.#lower.value, this.#upper.value];
    if (!Number.isFinite(lower) || !Number.isFinite(upper)) return undefined;
    return { offset: (lower + upper) / 2, error: (upper - lower) / 2 };
  }
}
