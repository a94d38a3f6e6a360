// The daemon's scene and views, and their changes. Every change contains the revision that the form was filled from. If another client has changed
// the scene in the meantime, the daemon refuses the change, and the forms are filled again. No change is thus overwritten unnoticed.

import type { MessageInitShape } from "@bufbuild/protobuf";

import type { Info } from "../gen/steradian/v1/diagnostics_pb.ts";
import type { Scene, SceneSchema } from "../gen/steradian/v1/scene_pb.ts";
import type { Frame, View, ViewDefinitionSchema, ViewSchema } from "../gen/steradian/v1/view_pb.ts";
import { milliseconds } from "./clock.ts";
import { onEdit } from "./dom.ts";
import { notify } from "./notices.ts";
import { PATIENCE_MS, diagnostics, failureOf, messageOf, scenes, views } from "./rpc.ts";

/** Long timeout, because asteroids are placed before the answer. */
const CHANGE_PATIENCE_MS = 120_000;

/** Cause of a change of the scene. */
export interface SceneChange {
  /** If this page made the change, the revision before it: forms with that revision remain valid. */
  ownFrom: bigint | undefined;
  /** Whether a form's change was refused because of its revision. */
  conflict: boolean;
  /** Whether everything was reloaded, as after a restart of the daemon. */
  anew: boolean;
}

const READ: SceneChange = { ownFrom: undefined, conflict: false, anew: false };

export class Model extends EventTarget {
  #scene: Scene | undefined;
  #views: View[] = [];
  #info: Info | undefined;
  #reading: Promise<void> | undefined;
  /** Time of the browser at which the scene was read, ms. */
  #readAt = 0;

  get scene(): Scene | undefined {
    return this.#scene;
  }

  /** Returns the current scene time, ms since 1970; undefined for years outside of 1 to 9999. */
  timeMs(): number | undefined {
    const { time, timeRate = 0 } = this.#scene ?? {};
    return time && milliseconds(time) + timeRate * (performance.now() - this.#readAt);
  }

  get views(): View[] {
    return this.#views;
  }

  get info(): Info | undefined {
    return this.#info;
  }

  /** Reads everything. */
  async load(signal: AbortSignal): Promise<void> {
    const options = { signal, timeoutMs: PATIENCE_MS };
    const [scene, list, info] = await Promise.all([
      scenes.getScene({}, options),
      views.listViews({}, options),
      diagnostics.getInfo({}, options),
    ]);
    this.#info = info;
    this.dispatchEvent(new Event("loaded"));
    this.#take(scene, list.views, { ...READ, anew: true });
  }

  #take(scene: Scene, list: View[], change: SceneChange): void {
    this.#scene = scene;
    this.#readAt = performance.now();
    this.#views = list;
    this.dispatchEvent(new CustomEvent<SceneChange>("change", { detail: change }));
  }

  /** Records the scene revision of a frame: a newer one means that another client has changed the scene. */
  observe(frame: Frame): void {
    if (this.#scene && !this.#reading && frame.sceneRevision > this.#scene.revision) void this.refresh();
  }

  /** Reloads scene and views. Reports errors, except a lost connection, which the session reports. */
  async refresh(change: SceneChange = READ): Promise<void> {
    while (this.#reading) await this.#reading;
    this.#reading = this.#read(change);
    await this.#reading;
  }

  async #read(change: SceneChange): Promise<void> {
    try {
      const options = { timeoutMs: PATIENCE_MS };
      const [scene, list] = await Promise.all([scenes.getScene({}, options), views.listViews({}, options)]);
      this.#take(scene, list.views, change);
    } catch (error) {
      if (failureOf(error) === "refused") notify(`Scene: ${messageOf(error)}`, "error");
    } finally {
      this.#reading = undefined;
    }
  }

  /** Changes the fields that the paths name. If the daemon refuses the change, reports this and returns false. */
  async changeScene(scene: MessageInitShape<typeof SceneSchema>, paths: string[], revision: bigint): Promise<boolean> {
    const request = { scene, updateMask: { paths }, expectedRevision: revision };
    return this.#change("Scene", revision, async () => {
      const changed = await scenes.updateScene(request, { timeoutMs: CHANGE_PATIENCE_MS });
      return changed.revision;
    });
  }

  /** Changes a view in the same way. */
  async changeView(view: MessageInitShape<typeof ViewSchema>, paths: string[], revision: bigint): Promise<boolean> {
    const request = { view, updateMask: { paths }, expectedRevision: revision };
    return this.#change(`View ${view.name}`, revision, async () => {
      const changed = await views.updateView(request, { timeoutMs: CHANGE_PATIENCE_MS });
      return changed.revision;
    });
  }

  /** Creates a view in the same way. */
  async createView(definition: MessageInitShape<typeof ViewDefinitionSchema>, revision: bigint): Promise<boolean> {
    return this.#change(`View ${definition.name}`, revision, async () => {
      const made = await views.createView({ definition, expectedRevision: revision }, { timeoutMs: CHANGE_PATIENCE_MS });
      return made.revision;
    });
  }

  /** Deletes a view in the same way. */
  async deleteView(name: string, revision: bigint): Promise<boolean> {
    return this.#change(`View ${name}`, revision, async () => {
      const deleted = await views.deleteView({ view: name, expectedRevision: revision }, { timeoutMs: CHANGE_PATIENCE_MS });
      return deleted.revision;
    });
  }

  async #change(what: string, from: bigint, change: () => Promise<bigint>): Promise<boolean> {
    try {
      const to = await change();
      await this.refresh(to === from + 1n ? { ...READ, ownFrom: from } : READ);
      return true;
    } catch (error) {
      switch (failureOf(error)) {
        case "conflict":
          notify(
            `${what}: another client has changed the scene meanwhile. Your change was not made; the form shows the scene as it is now.`,
            "warning",
          );
          await this.refresh({ ...READ, conflict: true });
          break;
        case "unreachable":
          notify(`${what}: the daemon has not answered; whether the change was made is not known.`, "error");
          break;
        default:
          notify(`${what}: ${messageOf(error)}`, "error");
      }
      return false;
    }
  }
}

/**
 * The revision that a form was filled from, and whether it was edited since. An edited form is not refilled when the scene
 * changes: its change is then refused and reported.
 */
export class FormState {
  revision = 0n;
  dirty = false;

  /** Whether the form should be filled now. */
  follows(scene: Scene, { ownFrom, conflict, anew }: SceneChange): boolean {
    if (this.dirty && !conflict && !anew) {
      if (ownFrom === this.revision) this.revision += 1n;
      return false;
    }
    if (this.dirty && anew) notify("An edited form was replaced by the daemon's current values.", "warning");
    this.revision = scene.revision;
    this.dirty = false;
    return true;
  }

  /** Marks the form as edited. */
  watch(form: HTMLElement): void {
    onEdit(form, () => {
      this.dirty = true;
    });
  }
}
