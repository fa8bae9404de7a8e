// Jog: the motor turns while a key or button is held. The server stops it by itself 500 ms after the last word from here.

import { h, replace, setText, shown } from "./dom.js";
import { PAGE_ID, api, ofAxis } from "./net.js";

/** How often the server is told that the key is still held. */
const RENEW_MS = 150;
/** A renewal that takes so long has come too late for the server. */
const LATE_MS = 1000;
/** The speeds that the slider goes between, in full steps a second. */
const SLOWEST = 20;
const FASTEST = 2000;
const KEYS = { ArrowRight: "+", ArrowLeft: "-" };

/** Counts the presses, so that a word of one that is over is known as such however late it comes. */
let holds = 0;
/** Where the slider of each drive was left, by its name. */
const chosen = new Map();

/** Shows the jog buttons of `context.axis` in `root`. */
export function mountJog(root, context) {
  const { axis } = context;
  // The slider is in hundredths of the logarithm, so that slow speeds can be chosen as well as fast ones.
  const slider = h("input", { type: "range", id: "jog-speed", "aria-label": "Jog speed", min: "0", max: "100", value: chosen.get(axis.name) ?? "50", "aria-valuetext": "" });
  const speed = () => slowest(axis) * (FASTEST / SLOWEST) ** (Number(slider.value) / 100);
  const text = h("output", { class: "number", for: "jog-speed" });
  const tell = () => {
    chosen.set(axis.name, slider.value);
    setText(text, `${shown(speed())} ${axis.unit}/s`);
    slider.setAttribute("aria-valuetext", text.textContent);
  };
  slider.addEventListener("input", tell);
  context.jogSpeed = speed;
  tell();

  let hold = null;
  const begin = (direction) => {
    if (hold) return;
    holds += 1;
    hold = { press: holds, direction, busy: false, request: null };
    renew();
    hold.timer = setInterval(renew, RENEW_MS);
    document.getElementById(direction === "+" ? "jog-forward" : "jog-back")?.classList.add("held");
  };
  const renew = async () => {
    const mine = hold;
    if (!mine || mine.busy) return;
    mine.busy = true;
    mine.request = new AbortController();
    const late = setTimeout(() => mine.request.abort(new DOMException("late", "TimeoutError")), LATE_MS);
    try {
      await api("POST", ofAxis(axis.name, "/jog"), { direction: mine.direction, speed: speed(), id: PAGE_ID, press: mine.press }, { signal: mine.request.signal, urgent: true });
    } catch (error) {
      if (hold === mine) {
        end(false);
        context.notify("error", error.message, { about: error.action });
      }
    }
    clearTimeout(late);
    mine.busy = false;
  };
  const end = (tellServer = true) => {
    if (!hold) return;
    const { press, timer, request } = hold;
    clearInterval(timer);
    // What waits for a connection must not leave any more.
    request?.abort();
    hold = null;
    for (const button of root.querySelectorAll(".held")) button.classList.remove("held");
    if (!tellServer) return;
    // Should it not arrive, the server stops by itself.
    api("POST", ofAxis(axis.name, "/jog/end"), { id: PAGE_ID, press }, { keepalive: true, urgent: true }).catch(() => {});
  };

  const button = (direction, id, label) => h("button", {
    type: "button", class: "jog moves", id, "aria-label": `Jog ${direction === "+" ? "forward" : "backward"}, while it is held`,
    onpointerdown: (event) => {
      if (event.button !== 0) return;
      event.currentTarget.setPointerCapture(event.pointerId);
      begin(direction);
    },
    onpointerup: () => end(), onpointercancel: () => end(), onlostpointercapture: () => end(),
    oncontextmenu: (event) => event.preventDefault(),
    // Enter held on the button is as good as the mouse.
    onkeydown: (event) => { if (event.key === "Enter") { event.preventDefault(); begin(direction); } },
    onkeyup: (event) => { if (event.key === "Enter") end(); },
    onblur: () => end(),
  }, label);

  const isField = (element) => ["INPUT", "TEXTAREA", "SELECT"].includes(element.tagName) || element.closest?.(".tabs");
  const keydown = (event) => {
    const direction = KEYS[event.key];
    if (!direction || isField(event.target) || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    if (!event.repeat) begin(direction);
  };
  const keyup = (event) => { if (KEYS[event.key]) end(); };
  const away = () => end();
  const hidden = () => { if (document.hidden) end(); };
  addEventListener("keydown", keydown);
  addEventListener("keyup", keyup);
  addEventListener("blur", away);
  addEventListener("pagehide", away);
  document.addEventListener("visibilitychange", hidden);
  document.addEventListener("stopping", away);

  replace(root,
    h("h2", {}, "Jog"),
    h("div", { class: "jog-pad" }, button("-", "jog-back", "◀ −"), button("+", "jog-forward", "+ ▶")),
    h("div", { class: "speed-row" }, h("label", { for: "jog-speed" }, "Speed"), slider, text),
    h("p", { class: "quiet" }, "Hold a button, or ", h("kbd", {}, "←"), " ", h("kbd", {}, "→"), "; it brakes when you let go. ",
      h("kbd", {}, "Space"), " stops, but in a text; ", h("kbd", {}, "Esc"), " stops there too, once it has closed what is open."));
  return () => {
    end();
    removeEventListener("keydown", keydown);
    removeEventListener("keyup", keyup);
    removeEventListener("blur", away);
    removeEventListener("pagehide", away);
    document.removeEventListener("visibilitychange", hidden);
    document.removeEventListener("stopping", away);
  };
}

/** The slowest speed for jogging, in the unit of the axis. */
const slowest = (axis) => SLOWEST / Math.abs(axis.steps_per_unit || 1);
