// The token for a daemon with access control. It is kept while the tab exists.

import type { Interceptor } from "@connectrpc/connect";

import { byId } from "./dom.ts";

const KEY = "steradian.token";

/** Adds the token to every call. */
export const authorise: Interceptor = (next) => (request) => {
  const token = sessionStorage.getItem(KEY);
  if (token !== null) request.header.set("authorization", `Bearer ${token}`);
  return next(request);
};

const form = byId("login") as HTMLFormElement;
const input = byId("login-token") as HTMLInputElement;
const logout = byId("logout");

function show(asks: boolean): void {
  form.hidden = !asks;
  logout.hidden = asks || sessionStorage.getItem(KEY) === null;
}
show(false);

logout.addEventListener("click", () => {
  sessionStorage.removeItem(KEY);
  location.reload();
});

/** Asks the user for a token, with the reason; waits for it. */
export function askForToken(why: string): Promise<void> {
  byId("login-why").textContent = why;
  show(true);
  input.value = "";
  input.focus();
  return new Promise((resolve) => {
    form.addEventListener(
      "submit",
      (event) => {
        event.preventDefault();
        sessionStorage.setItem(KEY, input.value.trim());
        input.value = "";
        show(false);
        resolve();
      },
      { once: true },
    );
  });
}
