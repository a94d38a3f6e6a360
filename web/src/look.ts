// Turning and flying the camera by mouse, finger and keys.
//
// A drag keeps its initial direction under the pointer: the sum of its rotations is the smallest one from its start, so
// that moving back restores the picture.

import type { ViewImage } from "../gen/steradian/v1/view_pb.ts";
import { IDENTITY, type Quat, type Vec3, add, around, between, inverse, multiply, rotate, scale } from "./maths.ts";
import { directionAt } from "./projection.ts";
import type { Motion as Step, Steering } from "./steering.ts";

/** Turning by keys, rad/s; a tenth of it with Shift. */
const TURN_RAD_S = 0.5;

/** Effect of a key while it is held: rotation about camera axes, motion along them. */
export type Motion = { turn: Vec3 } | { move: Vec3 };

const KEYS: Record<string, Motion> = {
  ArrowLeft: { turn: [0, 1, 0] },
  ArrowRight: { turn: [0, -1, 0] },
  ArrowUp: { turn: [1, 0, 0] },
  ArrowDown: { turn: [-1, 0, 0] },
  KeyZ: { turn: [0, 0, 1] },
  KeyX: { turn: [0, 0, -1] },
  KeyW: { move: [0, 0, -1] },
  KeyS: { move: [0, 0, 1] },
  KeyA: { move: [-1, 0, 0] },
  KeyD: { move: [1, 0, 0] },
  KeyQ: { move: [0, -1, 0] },
  KeyE: { move: [0, 1, 0] },
};

/** Motions while keys or buttons are held. */
export class Flight {
  /** Metres per second. */
  speed = 1000;
  #steering: Steering;
  #held = new Map<string, Motion>();
  #slow = false;
  #last = 0;
  #running = false;

  constructor(steering: Steering) {
    this.#steering = steering;
    // If a key is released while another window has the focus, this page gets no event.
    addEventListener("blur", () => this.#held.clear());
    document.addEventListener("visibilitychange", () => this.#held.clear());
  }

  hold(name: string, motion: Motion | undefined = KEYS[name]): void {
    if (!motion) return;
    this.#held.set(name, motion);
    if (this.#running) return;
    this.#running = true;
    this.#last = performance.now();
    requestAnimationFrame((time) => this.#step(time));
  }

  release(name: string): void {
    this.#held.delete(name);
  }

  releaseAll(): void {
    this.#held.clear();
  }

  /** Returns the effect of a key, if it has one. */
  motion(code: string): Motion | undefined {
    return KEYS[code];
  }

  set slow(slow: boolean) {
    this.#slow = slow;
  }

  #step(time: number): void {
    if (this.#held.size === 0) {
      this.#running = false;
      return;
    }
    // Limit the step after a long pause of the page.
    const seconds = Math.min(Math.max(time - this.#last, 0), 100) / 1000;
    this.#last = time;
    let turn: Vec3 = [0, 0, 0];
    let move: Vec3 = [0, 0, 0];
    for (const motion of this.#held.values()) {
      if ("turn" in motion) turn = add(turn, motion.turn);
      else move = add(move, motion.move);
    }
    const factor = seconds * (this.#slow ? 0.1 : 1);
    const { orientation, position } = this.#steering.pose;
    const angle = Math.hypot(...turn);
    const change: Step = {};
    if (angle > 0) change.turn = around(scale(turn, 1 / angle), angle * TURN_RAD_S * factor);
    if (Math.hypot(...move) > 0) {
      change.position = add(position, rotate(orientation, scale(move, this.speed * factor)));
    }
    if (seconds > 0 && (change.turn || change.position)) this.#steering.steer(change);
    requestAnimationFrame((next) => this.#step(next));
  }
}

/** A pressed pointer. */
interface Drag {
  pointer: number;
  /** Its initial direction in camera axes, and in ICRS axes at that time. */
  from: Vec3;
  icrs: Vec3;
  /** Rotation of the camera by this drag so far. */
  turned: Quat;
  /** Position in the picture, 0 to 1. */
  at: readonly [number, number];
  /** Initial position, CSS pixels. */
  pressed: readonly [number, number];
  moved: boolean;
}

/** A shorter movement counts as a click, CSS pixels. */
const CLICK_PX = 4;

/** Angle of a screen pixel at the centre of a picture, rad. */
function anglePerPixel(canvas: HTMLCanvasElement, image: () => ViewImage | undefined): number {
  const shown = image();
  const step = 1 / Math.max(canvas.clientWidth, 1);
  const [a, b] = [shown && directionAt(shown, 0.5, 0.5), shown && directionAt(shown, 0.5 + step, 0.5)];
  return a && b ? Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]) : 0;
}

/**
 * Handles drags and clicks of a picture, and keys while it has the focus, until it is removed. `image` returns the displayed image, `named` is called with the
 * direction of a click, ICRS axes.
 */
export function attach(
  canvas: HTMLCanvasElement,
  image: () => ViewImage | undefined,
  steering: Steering,
  flight: Flight,
  named: (direction: Vec3, radPerPixel: number) => void,
  gone: AbortSignal,
): void {
  let drag: Drag | undefined;

  const begin = ({ pointer, at, pressed, moved }: Pick<Drag, "pointer" | "at" | "pressed" | "moved">) => {
    const shown = image();
    const from = shown && directionAt(shown, ...at);
    const { orientation } = steering.pose;
    drag = from && { pointer, from, icrs: rotate(orientation, from), turned: IDENTITY, at, pressed, moved };
  };
  const place = (event: PointerEvent): readonly [number, number] => {
    const { left, top, width, height } = canvas.getBoundingClientRect();
    return [(event.clientX - left) / width, (event.clientY - top) / height];
  };

  canvas.addEventListener("pointerdown", (event) => {
    if (event.button !== 0 || drag) return;
    canvas.setPointerCapture(event.pointerId);
    canvas.focus({ preventScroll: true });
    begin({ pointer: event.pointerId, at: place(event), pressed: [event.clientX, event.clientY], moved: false });
    canvas.classList.toggle("dragged", drag !== undefined);
    event.preventDefault();
  });
  canvas.addEventListener("pointermove", (event) => {
    if (drag?.pointer !== event.pointerId) return;
    // A click may include a small movement.
    drag.moved ||= Math.hypot(event.clientX - drag.pressed[0], event.clientY - drag.pressed[1]) >= CLICK_PX;
    if (!drag.moved) return;
    const shown = image();
    const at = place(event);
    const now = shown && directionAt(shown, ...at);
    // Outside a round picture, no direction exists: the drag waits until the pointer returns.
    if (!now) return;
    drag.at = at;
    const turned = between(now, drag.from);
    steering.steer({ turn: multiply(inverse(drag.turned), turned) });
    drag.turned = turned;
  });
  const end = (event: PointerEvent) => {
    if (drag?.pointer !== event.pointerId) return;
    const { moved, icrs } = drag;
    drag = undefined;
    if (event.type === "pointerup" && !moved) named(icrs, anglePerPixel(canvas, image));
    canvas.classList.remove("dragged");
  };
  canvas.addEventListener("pointerup", end);
  canvas.addEventListener("pointercancel", end);
  canvas.addEventListener("lostpointercapture", end);
  const again = () => {
    if (drag) begin(drag);
  };
  steering.addEventListener("moved", again, { signal: gone });

  canvas.addEventListener("keydown", (event) => {
    flight.slow = event.shiftKey;
    if (event.ctrlKey || event.altKey || event.metaKey || !flight.motion(event.code)) return;
    flight.hold(event.code);
    event.preventDefault();
  });
  canvas.addEventListener("keyup", (event) => {
    flight.slow = event.shiftKey;
    flight.release(event.code);
  });
  canvas.addEventListener("blur", () => flight.releaseAll());
}
