// The call that fetches pictures.

import { type Frame, type NextFrameRequest } from "../gen/steradian/v1/view_pb.ts";
import { FRAME_PATIENCE_MS, views } from "./rpc.ts";

export type Wanted = Pick<NextFrameRequest, "view" | "encoding" | "afterFrameNumber" | "video" | "maxSize">;

/** Returns the frames after the last received ones, of all views that are ready. */
export async function nextFrames(wanted: Wanted[], signal: AbortSignal): Promise<Frame[]> {
  const { frames } = await views.nextFrames({ views: wanted }, { signal, timeoutMs: FRAME_PATIENCE_MS });
  return frames;
}
