// Steers the camera. Only one call at a time is in transit. In the meantime, each new pose replaces the one that is waiting, and the last pose is
// sent next.
//
// Every pose contains the revision that it was made from. If another client has moved the camera since, the daemon
// refuses the pose: the page takes over the current camera, reports it, and continues from there.
//
// Rotations are relative, and the daemon applies them to the camera's current orientation: a camera that is fixed to the horizon turns relative to
// the stars without a new revision. Each frame contains its camera, which the page follows.

import type { MessageInitShape } from "@bufbuild/protobuf";

import type { Camera, SetCameraRequestSchema } from "../gen/steradian/v1/camera_pb.ts";
import { type Clock, now } from "./clock.ts";
import { IDENTITY, type Quat, type Vec3, multiply } from "./maths.ts";
import { notify } from "./notices.ts";
import { PATIENCE_MS, cameras, failureOf, isHeld, messageOf } from "./rpc.ts";

export interface Pose {
  orientation: Quat;
  position: Vec3;
}

/** Effect of a drag, key or button. */
export interface Motion {
  /** Rotation about the axes of the camera. */
  turn?: Quat;
  position?: Vec3;
}

type Change = MessageInitShape<typeof SetCameraRequestSchema>;

export class Steering extends EventTarget {
  #clock: Clock;
  #known: Camera | undefined;
  #pose: Pose = { orientation: IDENTITY, position: [0, 0, 0] };
  #wanted: Motion | undefined;
  #sending = false;
  #mayMove = true;

  constructor(clock: Clock) {
    super();
    this.#clock = clock;
  }

  /** The last requested pose, or that of the daemon. */
  get pose(): Pose {
    return this.#pose;
  }

  /** The last camera reported by the daemon. */
  get camera(): Camera | undefined {
    return this.#known;
  }

  /** Reloads the camera, because revisions restart with the daemon. */
  async load(signal: AbortSignal): Promise<void> {
    this.#wanted = undefined;
    this.#take(await cameras.getCamera({}, { signal, timeoutMs: PATIENCE_MS }));
  }

  /** Whether the role of the user allows steering. */
  get mayMove(): boolean {
    return this.#mayMove;
  }

  set mayMove(may: boolean) {
    this.#mayMove = may;
    this.dispatchEvent(new Event("role"));
  }

  /** Records the camera of a frame. Ignores it if it is older than the known camera, or if the page is sending a pose. */
  observe(camera: Camera): void {
    if (this.#sending || this.#wanted || (this.#known && camera.revision < this.#known.revision)) return;
    this.#take(camera);
  }

  /** Turns or moves the camera. Waiting turns are added up; of waiting positions, the latest wins. */
  steer(motion: Motion): void {
    if (!this.#mayMove) {
      notify("The view role may not steer.", "warning");
      return;
    }
    const wanted = this.#wanted ?? {};
    if (motion.turn) wanted.turn = multiply(wanted.turn ?? IDENTITY, motion.turn);
    if (motion.position) wanted.position = motion.position;
    this.#wanted = wanted;
    this.#pose = moved(this.#pose, motion);
    this.dispatchEvent(new Event("pose"));
    void this.#send();
  }

  /** Sets values of the camera at once, as from a form; throws errors. */
  async set(change: Change): Promise<void> {
    const sent = now();
    const revision = this.#known?.revision;
    try {
      const expected = revision === undefined ? {} : { expectedRevision: revision };
      const camera = await cameras.setCamera({ ...change, ...expected }, { timeoutMs: PATIENCE_MS });
      this.#clock.poseSent(camera.revision, sent);
      this.#take(camera);
    } catch (error) {
      if (failureOf(error) === "conflict") await this.#moved();
      if (isHeld(error)) throw new Error(await this.#holder());
      throw error;
    }
  }

  async #send(): Promise<void> {
    if (this.#sending) return;
    this.#sending = true;
    try {
      while (this.#wanted) {
        const { turn, position } = this.#wanted;
        this.#wanted = undefined;
        const wanted: Change = {};
        if (turn) wanted.turn = { x: turn[0], y: turn[1], z: turn[2], w: turn[3] };
        if (position) wanted.positionM = { x: position[0], y: position[1], z: position[2] };
        const sent = now();
        const expected = this.#known ? { expectedRevision: this.#known.revision } : {};
        const camera = await cameras.setCamera({ ...wanted, ...expected }, { timeoutMs: PATIENCE_MS });
        this.#clock.poseSent(camera.revision, sent);
        this.#take(camera);
      }
    } catch (error) {
      this.#wanted = undefined;
      await this.#refused(error);
    } finally {
      this.#sending = false;
    }
  }

  async #refused(error: unknown): Promise<void> {
    const failure = failureOf(error);
    // In the other cases, the session reports a lost daemon or asks for a token, and reloads the camera afterwards.
    if (failure === "unreachable" || failure === "unknown" || failure === "ended") return;
    if (isHeld(error)) notify(await this.#holder(), "warning");
    else if (failure === "refused") notify(`Camera: ${messageOf(error)}`, "error");
    else notify("Another client has moved the camera: steering continues from there.", "warning");
    await this.#moved();
  }

  /** Returns a sentence that names the holder of the camera's lease. */
  async #holder(): Promise<string> {
    const { holder } = await cameras.getCamera({}, { timeoutMs: PATIENCE_MS });
    if (!holder) return "Another client held the lease of the camera and has now released it: try again.";
    return `\`${holder}\` holds the lease of the camera: the page can steer when it releases it.`;
  }

  async #moved(): Promise<void> {
    try {
      this.#take(await cameras.getCamera({}, { timeoutMs: PATIENCE_MS }));
    } catch (error) {
      if (failureOf(error) === "refused") notify(`Camera: ${messageOf(error)}`, "error");
    }
    // Drags continue from the current camera.
    this.dispatchEvent(new Event("moved"));
  }

  #take(camera: Camera): void {
    this.#known = camera;
    const { orientation: q, positionM: p } = camera;
    const pose: Pose = {
      orientation: q ? [q.x, q.y, q.z, q.w] : IDENTITY,
      position: p ? [p.x, p.y, p.z] : [0, 0, 0],
    };
    this.#pose = this.#wanted ? moved(pose, this.#wanted) : pose;
    this.dispatchEvent(new Event("pose"));
  }
}

/** Returns a pose after a motion. */
function moved({ orientation, position }: Pose, motion: Motion): Pose {
  return {
    orientation: motion.turn ? multiply(orientation, motion.turn) : orientation,
    position: motion.position ?? position,
  };
}
