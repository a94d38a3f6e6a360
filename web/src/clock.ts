// The daemon's clock by that of the browser. Nobody tells the offset between the two, but messages bound it: what the daemon stamps after the browser
// has sent something and before the answer is there lies between these two moments. The offset is the middle of the narrowest bounds.

import type { Timestamp } from "@bufbuild/protobuf/wkt";

/** Clocks drift: bounds that are older than this are forgotten once there are others. */
const MEMORY_MS = 600_000;
/** Poses whose way to the pictures is followed at once. */
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

  /** Forgets everything: another daemon may have another clock. */
  reset(): void {
    this.#lower = { value: -Infinity, at: -Infinity };
    this.#upper = { value: Infinity, at: -Infinity };
    this.#sent.clear();
  }

  /** Something stamped by the daemon has just arrived. */
  arrived(stamp: number, at = now()): void {
    const value = stamp - at;
    if (value > this.#lower.value || at - this.#lower.at > MEMORY_MS) this.#lower = { value, at };
    this.#agree();
  }

  /** Something was stamped after the browser had asked for it. */
  stampedAfter(stamp: number, asked: number): void {
    const value = stamp - asked;
    if (value < this.#upper.value || asked - this.#upper.at > MEMORY_MS) this.#upper = { value, at: asked };
    this.#agree();
  }

  /** A pose was sent at a time; the answer tells its revision. */
  poseSent(revision: bigint, at: number): void {
    this.#sent.set(revision, at);
    const oldest = this.#sent.keys().next();
    if (this.#sent.size > MOST_POSES && !oldest.done) this.#sent.delete(oldest.value);
  }

  /** A frame shows a pose that the daemon has received at a time: if it was ours, that was after it was sent. */
  poseShown(revision: bigint, poseTime: number): void {
    const sent = this.#sent.get(revision);
    if (sent !== undefined) this.stampedAfter(poseTime, sent);
  }

  // A clock that was set makes old bounds wrong, and they then exclude new ones: the newer one counts.
  #agree(): void {
    if (this.#lower.value <= this.#upper.value) return;
    if (this.#lower.at > this.#upper.at) this.#upper = { value: this.#lower.value, at: this.#lower.at };
    else this.#lower = { value: this.#upper.value, at: this.#upper.at };
  }

  /** Time of the daemon minus time of the browser, and how far it may be off, both ms; undefined while too little is known. */
  offset(): { offset: number; error: number } | undefined {
    const [lower, upper] = [this.#lower.value, this.#upper.value];
    if (!Number.isFinite(lower) || !Number.isFinite(upper)) return undefined;
    return { offset: (lower + upper) / 2, error: (upper - lower) / 2 };
  }
}
