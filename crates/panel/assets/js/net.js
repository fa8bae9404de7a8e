// The way to the server: requests, and streams of events.

const TOKEN = "stepdrive-token";
/** A stream of axes that is silent for so long is dead: the server says something at least every 250 ms. */
const SILENCE_MS = 2500;
/** How long something urgent waits before streams make room for it. */
const PATIENCE_MS = 300;
/** For how long they do. */
const ROOM_MS = 700;
const FIRST_REST_MS = 250;
const LONGEST_REST_MS = 2000;

/** Why a request was not answered with what it asked for; `action` names the request. */
export class ApiError extends Error {
  constructor(status, message, body = {}) {
    super(message);
    this.status = status;
    this.body = body;
    this.action = null;
  }
}

let askForToken = async () => null;
/** Says who asks a person for the token; it is told whether one was refused. */
export function onTokenWanted(ask) {
  askForToken = ask;
}

let succeeded = () => {};
/** Says who is told the `action` of every request that succeeds. */
export function onSuccess(tell) {
  succeeded = tell;
}

let refused = () => {};
/** Says who is told that a stream is refused, by its path and why; and with null that it is so no longer. */
export function onRefused(tell) {
  refused = tell;
}

const token = () => sessionStorage.getItem(TOKEN);

let asking = null;
/** Gets another token than the one that was refused. Answers whether there is one. */
async function newToken(old) {
  // Another request was refused before, and has asked already.
  if (token() !== old) return true;
  asking ??= askForToken(old !== null).finally(() => { asking = null; });
  const given = await asking;
  if (given) sessionStorage.setItem(TOKEN, given);
  return Boolean(given);
}

const headers = (extra = {}) => (token() ? { ...extra, Authorization: `Bearer ${token()}` } : extra);

async function problem(response) {
  let body = {};
  try {
    body = await response.json();
  } catch {
    // What is no JSON has nothing more to tell than its status.
  }
  return new ApiError(response.status, body.error ?? `the server answered ${response.status}`, body);
}

/** Makes a request. Answers the JSON of the reply, or throws an ApiError; status 0 means that there was no reply. */
export async function api(method, path, body, options = {}) {
  let used = null;
  const send = () => {
    used = token();
    return request(method, path, body, options);
  };
  // What is only looked at beforehand is not what was asked for.
  const action = body?.dry_run ? null : `${method} ${path}`;
  let text;
  try {
    let response = await send();
    while (response.status === 401 && await newToken(used)) response = await send();
    if (!response.ok) throw await problem(response);
    text = await response.text();
  } catch (error) {
    throw Object.assign(error instanceof ApiError ? error : noReply(error), { action });
  }
  if (action) succeeded(action);
  return text ? JSON.parse(text) : {};
}

function request(method, path, body, options) {
  return fetch(path, {
    method,
    headers: headers(body === undefined ? {} : { "Content-Type": "application/json" }),
    body: body === undefined ? undefined : JSON.stringify(body),
    signal: options.signal ?? AbortSignal.timeout(options.timeout ?? 10_000),
    keepalive: options.keepalive ?? false,
    priority: options.urgent ? "high" : "auto",
  });
}

function noReply(error) {
  const why = error.name === "TimeoutError" ? "it did not answer in time" : "it cannot be reached";
  return new ApiError(0, `no reply from the server: ${why}`);
}

/** A request that must not wait: should it not have been answered soon, streams make room for it. */
export async function urgently(method, path, body, timeout) {
  const room = setTimeout(makeRoom, PATIENCE_MS);
  try {
    return await api(method, path, body, { urgent: true, keepalive: true, timeout });
  } finally {
    clearTimeout(room);
  }
}

/** Whether the server has something under a path. */
export async function has(path) {
  try {
    await api("HEAD", path);
    return true;
  } catch (error) {
    if (error.status === 404) return false;
    throw error;
  }
}

/* A browser has six connections to a server, however many of its tabs show the panel, and each stream takes one. So hidden
 * tabs let go of theirs when another is looked at, and all do for a moment when a stop does not get through. */

const streams = new Set();
const tabs = new BroadcastChannel("stepdrive-panel");
let asleep = false;
const sleepers = new Set();

function dropStreams() {
  for (const stream of streams) stream.drop();
}

function makeRoom() {
  tabs.postMessage("make room");
  dropStreams();
}

/** Comes when streams may begin again. */
async function mayGoOn() {
  do {
    await new Promise((done) => {
      if (asleep) sleepers.add(done);
      else setTimeout(done, ROOM_MS);
    });
  } while (asleep);
}

tabs.addEventListener("message", ({ data }) => {
  if (data === "looked at" && document.hidden) asleep = true;
  if (asleep || data === "make room") dropStreams();
});

function lookedAt() {
  if (document.hidden) return;
  asleep = false;
  for (const wake of sleepers) wake();
  sleepers.clear();
  tabs.postMessage("looked at");
}
document.addEventListener("visibilitychange", lookedAt);
lookedAt();

/** Follows a stream of server-sent events until `close()`. `handlers` are called by the name of the event with its data;
 * `onLink(true | false)` tells when the stream stands and when it is lost. It reconnects by itself. A stream that says less
 * often that it lives needs a longer `silence`. Its `heard` is when the server said something last. */
export function follow(path, handlers, onLink = () => {}, silence = SILENCE_MS) {
  let closed = false;
  let dropped = false;
  let abort = new AbortController();
  let rest = FIRST_REST_MS;
  const stream = {
    heard: 0,
    drop() {
      dropped = true;
      abort.abort();
    },
    close() {
      closed = true;
      streams.delete(stream);
      abort.abort();
      refused(path, null);
    },
  };
  streams.add(stream);
  const told = {
    open() {
      rest = FIRST_REST_MS;
      refused(path, null);
      onLink(true);
    },
    word() {
      stream.heard = performance.now();
    },
  };
  const wait = async () => {
    // Who sleeps for long shows what has long ceased to be true.
    if (asleep) onLink(false);
    await mayGoOn();
    dropped = false;
  };
  const run = async () => {
    while (!closed) {
      if (dropped) await wait();
      if (closed) return;
      abort = new AbortController();
      const used = token();
      try {
        await read(path, handlers, abort, silence, told);
      } catch (error) {
        if (!closed && !dropped) onLink(false, error);
        if (error.status === 401 && await newToken(used)) continue;
        if (error.status === 404 || error.status === 422) return;
        if (error.status && !closed) refused(path, error);
      }
      if (closed) return;
      if (dropped) continue;
      onLink(false);
      await new Promise((done) => setTimeout(done, rest));
      rest = Math.min(rest * 2, LONGEST_REST_MS);
    }
  };
  run();
  return stream;
}

async function read(path, handlers, abort, silence, told) {
  let timer = setTimeout(() => abort.abort(), silence);
  try {
    const response = await fetch(path, { headers: headers({ Accept: "text/event-stream" }), signal: abort.signal });
    if (!response.ok) throw await problem(response);
    told.word();
    told.open();
    const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
    let text = "";
    for (;;) {
      const { done, value } = await reader.read();
      if (done) return;
      clearTimeout(timer);
      timer = setTimeout(() => abort.abort(), silence);
      told.word();
      text += value;
      const parts = text.split("\n\n");
      text = parts.pop();
      for (const part of parts) dispatch(part, handlers);
    }
  } finally {
    clearTimeout(timer);
  }
}

function dispatch(part, handlers) {
  let name = "message";
  const data = [];
  for (const line of part.split("\n")) {
    if (line.startsWith("event:")) name = line.slice(6).trim();
    else if (line.startsWith("data:")) data.push(line.slice(5).trimStart());
  }
  if (data.length && handlers[name]) handlers[name](JSON.parse(data.join("\n")));
}

/** A name of this page, by which the server knows whose jog it is. */
export const PAGE_ID = Array.from(crypto.getRandomValues(new Uint8Array(8)), (byte) => byte.toString(16).padStart(2, "0")).join("");

/** The path of an axis' own requests. */
export const ofAxis = (name, rest = "") => `/v1/axes/${encodeURIComponent(name)}${rest}`;
