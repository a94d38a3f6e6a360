// Position and direction of the camera: displayed, set by numbers, and steered by buttons, which replace keys on touch
// screens.

import { field, make, numberInput, numberOf, onEdit, plain } from "./dom.ts";
import type { Flight } from "./look.ts";
import { type Quat, orientationTowards, towards } from "./maths.ts";
import { notify } from "./notices.ts";
import { messageOf } from "./rpc.ts";
import type { Steering } from "./steering.ts";

const DEGREE = Math.PI / 180;

const AU_M = 1.495978707e11;
const PARSEC_M = 3.0856775814913673e16;

/** Range of the speed, metres per second, as powers of ten. */
const [SLOWEST, FASTEST] = [-2, 17];
const UNITS = [
  [1, "m/s"],
  [1e3, "km/s"],
  [AU_M, "au/s"],
  [PARSEC_M, "pc/s"],
] as const;

/** Buttons that act while held: key, label. */
const BUTTONS = [
  ["KeyW", "Forward"],
  ["KeyS", "Back"],
  ["KeyA", "Left"],
  ["KeyD", "Right"],
  ["KeyE", "Up"],
  ["KeyQ", "Down"],
  ["KeyZ", "Roll left"],
  ["KeyX", "Roll right"],
] as const;

export function speedText(metresPerSecond: number): string {
  const [factor, unit] = [...UNITS].reverse().find(([least]) => metresPerSecond >= least) ?? UNITS[0];
  return `${Number((metresPerSecond / factor).toPrecision(2))} ${unit}`;
}

export function cameraPanel(host: HTMLElement, steering: Steering, flight: Flight): void {
  const pointing = make("p", { id: "pointing", class: "figure" });
  const horizontal = make("p", { id: "horizontal", class: "figure", hidden: true });
  const place = make("p", { id: "place", class: "figure" });

  const speed = make("input", { type: "range", name: "speed", min: SLOWEST, max: FASTEST, step: 0.25, value: 3 });
  const speedTold = make("output", {});
  const setSpeed = () => {
    flight.speed = 10 ** Number(speed.value);
    speedTold.textContent = speedText(flight.speed);
    speed.setAttribute("aria-valuetext", speedTold.textContent);
  };
  speed.addEventListener("input", setSpeed);
  setSpeed();

  const buttons = BUTTONS.map(([code, label]) => {
    const button = make("button", { type: "button", class: "hold", text: label });
    const name = `button ${code}`;
    const press = () => flight.hold(name, flight.motion(code));
    const release = () => flight.release(name);
    button.addEventListener("pointerdown", (event) => {
      button.setPointerCapture(event.pointerId);
      press();
    });
    for (const end of ["pointerup", "pointercancel", "lostpointercapture", "blur"]) button.addEventListener(end, release);
    button.addEventListener("keydown", (event) => {
      if (event.code === "Space" || event.code === "Enter") press();
    });
    button.addEventListener("keyup", release);
    button.addEventListener("contextmenu", (event) => event.preventDefault());
    return button;
  });

  // The view role may not steer.
  const submit = make("button", { type: "submit", text: "Set camera" });
  const mayNot = make("p", { id: "may-not-steer", class: "hint", hidden: true, text: "Your role is view, which may not steer." });
  const setRole = () => {
    for (const button of [...buttons, submit]) button.disabled = !steering.mayMove;
    mayNot.hidden = steering.mayMove;
  };
  steering.addEventListener("role", setRole);

  const [ra, dec, roll] = [numberInput("right_ascension"), numberInput("declination"), numberInput("roll")];
  const position = (["x", "y", "z"] as const).map((axis) => numberInput(`position_m.${axis}`));
  const velocity = (["x", "y", "z"] as const).map((axis) => numberInput(`velocity_c.${axis}`));
  const triple = (label: string, unit: string, inputs: HTMLInputElement[]) => {
    inputs.forEach((input, index) => input.setAttribute("aria-label", `${label}, ${"xyz"[index]}, ${unit}`));
    return make("fieldset", { class: "triple" }, make("legend", { text: `${label} ` }, make("span", { class: "unit", text: unit })), ...inputs);
  };
  const form = make(
    "form",
    {},
    make("h3", { text: "Set" }),
    field("Right ascension", ra, "°"),
    field("Declination", dec, "°"),
    field("Roll", roll, "°, 0: north up"),
    triple("Position", "m, ICRS, from the barycentre", position),
    triple("Velocity", "of light", velocity),
    make("div", { class: "buttons" }, submit),
  );
  let dirty = false;
  onEdit(form, () => {
    dirty = true;
  });
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    try {
      const number = (input: HTMLInputElement) => numberOf(input) ?? 0;
      const vector = (inputs: HTMLInputElement[]) => {
        const [x = 0, y = 0, z = 0] = inputs.map(number);
        return { x, y, z };
      };
      // Unchanged values are not sent, so that they keep all digits and do not undo motion by other clients.
      const changed = (inputs: HTMLInputElement[]) => inputs.some((input) => input.value !== input.dataset["shown"]);
      const change: Parameters<Steering["set"]>[0] = {};
      if (changed([ra, dec, roll])) {
        const [x, y, z, w] = orientationTowards(number(ra) * DEGREE, number(dec) * DEGREE, number(roll) * DEGREE);
        change.orientation = { x, y, z, w };
      }
      if (changed(position)) change.positionM = vector(position);
      if (changed(velocity)) change.velocityC = vector(velocity);
      if (Object.keys(change).length === 0) return notify("No changes.");
      await steering.set(change);
      dirty = false;
      show();
      notify("The camera is set.");
    } catch (error) {
      notify(`Camera: ${messageOf(error)}`, "error");
    }
  });

  host.append(
    pointing,
    horizontal,
    place,
    mayNot,
    make("div", { class: "hold-buttons", role: "group", "aria-label": "Fly and roll while held" }, ...buttons),
    field("Speed", speed),
    speedTold,
    make("p", { class: "hint", text: "In a picture: drag or use the arrow keys to look around, W A S D Q E to fly, Z X to roll. Shift is ten times slower, + and − change the speed." }),
    form,
  );
  document.addEventListener("keydown", (event) => {
    if (!(event.target instanceof HTMLCanvasElement) || (event.key !== "+" && event.key !== "-")) return;
    if (event.key === "+") speed.stepUp(1);
    else speed.stepDown(1);
    setSpeed();
    event.preventDefault();
  });

  const show = () => {
    const { orientation, position: at } = steering.pose;
    const looks = towards(orientation as Quat);
    const degrees = (angle: number) => (angle / DEGREE).toFixed(2);
    pointing.textContent = `Looks at right ascension ${degrees(looks.ra)}°, declination ${degrees(looks.dec)}°, roll ${degrees(looks.roll)}°`;
    const look = steering.camera?.look;
    horizontal.hidden = look === undefined;
    if (look) {
      const [azimuth, altitude] = [look.longitudeDeg.toFixed(2), look.latitudeDeg.toFixed(2)];
      horizontal.textContent = `Azimuth ${azimuth}°, altitude ${altitude}°, roll ${look.rollDeg.toFixed(2)}°`;
    }
    const distance = Math.hypot(...at);
    const [far, unit] = distance >= 1e-3 * PARSEC_M ? [distance / PARSEC_M, "pc"] : distance >= 1e9 ? [distance / AU_M, "au"] : [distance, "m"];
    place.textContent = distance > 0 ? `${far.toPrecision(4)} ${unit} from the barycentre` : "At the barycentre";
    // A moving camera must not overwrite a form that is being edited.
    if (dirty) return;
    const fill = (input: HTMLInputElement, value: number) => {
      input.value = input.dataset["shown"] = plain(value);
    };
    const angles = [looks.ra, looks.dec, looks.roll];
    [ra, dec, roll].forEach((input, index) => fill(input, Number(((angles[index] ?? 0) / DEGREE).toFixed(6))));
    position.forEach((input, index) => fill(input, at[index] ?? 0));
    const { x = 0, y = 0, z = 0 } = steering.camera?.velocityC ?? {};
    velocity.forEach((input, index) => fill(input, [x, y, z][index] ?? 0));
  };
  steering.addEventListener("pose", show);
}
