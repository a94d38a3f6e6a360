// The camera as steered by the page. One call at a time is in transit; newer poses replace each other meanwhile, and
// the last one is sent next.
//
// Every pose contains the revision that it was made from. If another client has moved the camera since, the daemon
// refuses the pose: the page takes over the current camera, reports it, and continues from there.

import type { MessageInitShape } from "@bufbuild/protobuf";

import type { Camera, SetCameraRequestSchema } from "../gen/steradian/v1/camera_pb.ts";
import { type Clock, now } from "./clock.ts";
import { IDENTITY, type Quat, type Vec3 } from "./maths.ts";
import { notify } from "./notices.ts";
import { PATIENCE_MS, cameras, failureOf, messageOf } from "./rpc.ts";

export interface Pose {
  orientation: Quat;
  position: Vec3;
}

type Change = MessageInitShape<typeof SetCameraRequestSchema>;

export class Steering extends EventTarget {
  #clock: Clock;
  #known: Camera | undefined;
  #pose: Pose = { orientation: IDENTITY, position: [0, 0, 0] };
  #wanted: Change | undefined;
  #sending = false;

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

  /** Records the camera of a frame. Older cameras, and poses that the page has passed, are ignored. */
  observe(camera: Camera): void {
    if (this.#sending || this.#wanted || (this.#known && camera.revision <= this.#known.revision)) return;
    this.#take(camera);
  }

  /** Turns or moves the camera; the latest pose wins. */
  steer(change: Partial<Pose>): void {
    this.#pose = { ...this.#pose, ...change };
    const wanted: Change = { ...this.#wanted };
    if (change.orientation) {
      const [x, y, z, w] = change.orientation;
      wanted.orientation = { x, y, z, w };
    }
    if (change.position) {
      const [x, y, z] = change.position;
      wanted.positionM = { x, y, z };
    }
    this.#wanted = wanted;
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
      throw error;
    }
  }

  async #send(): Promise<void> {
    if (this.#sending) return;
    this.#sending = true;
    try {
      while (this.#wanted) {
        const wanted = this.#wanted;
        this.#wanted = undefined;
        const sent = now();
        const expected = this.#known ? { expectedRevision: this.#known.revision } : {};
        const camera = await cameras.setCamera({ ...wanted, ...expected }, { timeoutMs: PATIENCE_MS });
        this.#clock.poseSent(camera.revision, sent);
        this.#known = camera;
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
    // The session reports a lost daemon or asks for a token, and reloads the camera afterwards.
    if (failure === "unreachable" || failure === "unknown" || failure === "ended") return;
    if (failure === "refused") notify(`Camera: ${messageOf(error)}`, "error");
    else notify("Another client has moved the camera: going on from there.", "warning");
    await this.#moved();
  }

  async #moved(): Promise<void> {
    try {
      this.#take(await cameras.getCamera({}, { timeoutMs: PATIENCE_MS }));
    } catch (error) {
      if (failureOf(error) === "refused") notify(`Camera: ${messageOf(error)}`, "error");
    }
    // Drags restart from the current camera.
    this.dispatchEvent(new Event("moved"));
  }

  #take(camera: Camera): void {
    this.#known = camera;
    const { orientation: q, positionM: p } = camera;
    this.#pose = {
      orientation: q ? [q.x, q.y, q.z, q.w] : IDENTITY,
      position: p ? [p.x, p.y, p.z] : [0, 0, 0],
    };
    this.dispatchEvent(new Event("pose"));
  }
}
