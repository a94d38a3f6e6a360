// The daemon's calls over gRPC-Web, from the origin of the page.

import { Code, ConnectError, createClient } from "@connectrpc/connect";
import { createGrpcWebTransport } from "@connectrpc/connect-web";

import { CameraService } from "../gen/steradian/v1/camera_pb.ts";
import { DiagnosticsService } from "../gen/steradian/v1/diagnostics_pb.ts";
import { SceneService } from "../gen/steradian/v1/scene_pb.ts";
import { ViewService } from "../gen/steradian/v1/view_pb.ts";
import { authorise } from "./login.ts";

// The address is relative to the page, because a proxy may serve the page below a path.
const baseUrl = new URL(".", location.href).href.replace(/\/$/, "");
const transport = createGrpcWebTransport({ baseUrl, interceptors: [authorise] });

export const cameras = createClient(CameraService, transport);
export const scenes = createClient(SceneService, transport);
export const views = createClient(ViewService, transport);
export const diagnostics = createClient(DiagnosticsService, transport);

/** A daemon that does not answer a short call within this time counts as lost. */
export const PATIENCE_MS = 20_000;
/** The same for frames, which may take many seconds on a software driver. */
export const FRAME_PATIENCE_MS = 60_000;

export type Failure = "ended" | "unreachable" | "conflict" | "unknown" | "refused";

/** Classifies an error for the page. */
export function failureOf(error: unknown): Failure {
  const { code } = ConnectError.from(error);
  switch (code) {
    case Code.Canceled:
      return "ended";
    // A failed fetch has no code; a daemon that answers sends one.
    case Code.Unavailable:
    case Code.Unknown:
    case Code.DeadlineExceeded:
      return "unreachable";
    case Code.Aborted:
      return "conflict";
    case Code.Unauthenticated:
      return "unknown";
    default:
      return "refused";
  }
}

/** Whether another client holds the lease of the camera. */
export const isHeld = (error: unknown): boolean =>
  ConnectError.from(error).code === Code.FailedPrecondition && /^`.*` holds the lease of the camera/.test(ConnectError.from(error).rawMessage);

/** Returns the daemon's message. */
export function messageOf(error: unknown): string {
  const { rawMessage, code } = ConnectError.from(error);
  return rawMessage || Code[code];
}

/** Waits. The signal ends the wait early, without an error. */
export function pause(ms: number, signal: AbortSignal): Promise<void> {
  return new Promise((resolve) => {
    const end = () => {
      clearTimeout(timer);
      signal.removeEventListener("abort", end);
      resolve();
    };
    const timer = setTimeout(end, ms);
    signal.addEventListener("abort", end);
    if (signal.aborted) end();
  });
}
