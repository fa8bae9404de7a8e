// Jog: the motor turns while a key or button is held. The server stops it by itself 500 ms after the last word from here.

import { h, replace, setText, shown } from "./dom.js";
import { PAGE_ID, api, ofAxis } from "./net.js";

/** How often the server is told that the key is still held. */
const RENEW_MS = 150;
const KEYS = { ArrowRight: "+", ArrowLeft: "-" };

/** Counts the presses, so that a word of one that is over is known as such however late it comes. */
let holds = 0;

/** Shows the jog buttons of `context.axis` in `root`. */
export function mountJog(root, context) {
  const { axis } = context;
  const top = topSpeed(axis);
  // The slider is in hundredths of the logarithm, so that slow speeds can be chosen as well as fast ones.
  const slider = h("input", { type: "range", id: "jog-speed", min: "0", max: "100", value: "60", "aria-valuetext": "" });
  const speed = () => top * 10 ** ((Number(slider.value) - 100) / 40);
  const text = h("output", { class: "number", for: "jog-speed" });
  const tell = () => {
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
    hold = { press: holds, direction, busy: false };
    renew();
    hold.timer = setInterval(renew, RENEW_MS);
    document.getElementById(direction === "+" ? "jog-forward" : "jog-back")?.classList.add("held");
  };
  const renew = async () => {
    const mine = hold;
    if (!mine || mine.busy) return;
    mine.busy = true;
    try {
      await api("POST", ofAxis(axis.name, "/jog"), { direction: mine.direction, speed: speed(), id: PAGE_ID, press: mine.press }, { timeout: 1000, urgent: true });
    } catch (error) {
      if (hold === mine) {
        end(false);
        context.notify("error", error.message);
      }
    }
    mine.busy = false;
  };
  const end = (tellServer = true) => {
    if (!hold) return;
    const { press, timer } = hold;
    clearInterval(timer);
    hold = null;
    for (const button of root.querySelectorAll(".held")) button.classList.remove("held");
    if (!tellServer) return;
    // Should it not arrive, the server stops by itself.
    api("POST", ofAxis(axis.name, "/jog/end"), { id: PAGE_ID, press }, { keepalive: true, urgent: true }).catch(() => {});
  };

  const button = (direction, id, label) => h("button", {
    type: "button", class: "jog", id, "aria-label": `Jog ${direction === "+" ? "forward" : "backward"}, while it is held`,
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
  document.addEventListener("stopped-by-key", away);

  replace(root,
    h("h2", {}, "Jog"),
    h("div", { class: "jog-pad" }, button("-", "jog-back", "◀ −"), button("+", "jog-forward", "+ ▶")),
    h("div", { class: "field" }, h("label", { for: "jog-speed" }, "Speed while it is held"), slider, text),
    h("p", { class: "quiet" }, "Hold a button, or the arrow keys ", h("kbd", {}, "←"), " ", h("kbd", {}, "→"), "; it brakes when you let go."));
  return () => {
    end();
    removeEventListener("keydown", keydown);
    removeEventListener("keyup", keyup);
    removeEventListener("blur", away);
    removeEventListener("pagehide", away);
    document.removeEventListener("visibilitychange", hidden);
    document.removeEventListener("stopped-by-key", away);
  };
}

/** A brisk speed for jogging: 2000 full steps a second. */
const topSpeed = (axis) => 2000 / Math.abs(axis.steps_per_unit || 1);
