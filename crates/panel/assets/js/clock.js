// The time of a rig: read, paused, stepped, run until something holds, and how fast it passes.

import { h, replace, setClass, setText } from "./dom.js";

const SPEEDS = [["real", "▶ Real time"], ["x0.1", "x0.1"], ["x2", "x2"], ["x10", "x10"], ["x100", "x100"], ["x1000", "x1000"]];
const TICK_MS = 50;

/** Shows the clock in `root`; `act(method, path, body)` asks the rig. */
export function mountClock(root, context, act) {
  const now = h("div", { class: "big number", id: "rig-time" }, "–");
  const mode = h("span", { id: "clock", role: "status" });
  const reached = h("span", { class: "quiet number" });
  const speeds = h("div", { class: "chips", role: "group", "aria-label": "Speed of time" },
    [["paused", "❚❚ Pause"], ...SPEEDS].map(([to, label]) => h("button", { type: "button", class: "chip", id: to === "paused" ? "pause" : null, "data-mode": to,
      onclick: () => act("PUT", "/v1/clock", { mode: to }) }, label)));
  const step = h("input", { id: "step", value: "100ms", type: "text", autocomplete: "off" });
  const until = h("input", { id: "until", type: "text", autocomplete: "off", placeholder: "idle, or stage.ABS_POS >= 500" });
  const line = (label, field, button, submit) => h("form", { class: "ask", onsubmit: (event) => { event.preventDefault(); submit(); } },
    h("label", { for: field.id }, label), field, button);
  const runUntil = async () => {
    const answer = await act("POST", "/v1/clock/run-until", { until: until.value.trim() });
    if (answer) context.notify(answer.reached ? "good" : "error", answer.reached ? "Reached; time stands" : "It did not come within an hour of rig time");
  };
  replace(root, h("h2", {}, "Time"), now, h("p", {}, mode, " ", reached), speeds,
    line("Step by", step, h("button", { id: "do-step" }, "Step"), () => act("POST", "/v1/clock/step", { for: step.value.trim() })),
    line("Run until", until, h("button", { id: "do-run" }, "Run"), runUntil));

  /** What the rig said last, and when. */
  let told = null;
  let at = 0;
  let linked = false;
  let shownNs = 0;
  // The rig says what has changed, and time alone is no change: between its words time goes on here.
  const tick = () => {
    if (!told || !linked) return;
    const passed = told.clock.mode === "paused" ? 0 : (performance.now() - at) * 1e6 * told.clock.speed_reached;
    const ns = told.now_ns + passed;
    // It never seems to go back for having been guessed a little too far.
    shownNs = told.clock.mode === "paused" || ns > shownNs || shownNs - ns > 1e9 ? ns : shownNs;
    setText(now, `${(shownNs / 1e9).toFixed(3)} s`);
  };
  const ticking = setInterval(tick, TICK_MS);
  return {
    /** Shows whether the rig can be heard: time that nobody tells does not go on. */
    link(up) {
      linked = up;
      setClass(now, "doubtful", !up && told);
      if (up) return;
      setText(mode, "The server is not heard: what time it is there is not known.");
      setText(reached, "");
    },
    /** Shows what the rig says of its time. */
    update(rig) {
      told = rig;
      at = performance.now();
      const { mode: is, speed_reached: speed } = rig.clock;
      setText(mode, is === "paused" ? "Time stands." : `Time passes: ${is}${rig.playing ? `; playing ${rig.playing}` : ""}`);
      setText(reached, is === "paused" ? "" : `reached x${speed.toPrecision(3)}`);
      for (const button of speeds.children) button.setAttribute("aria-pressed", String(button.dataset.mode === is));
      tick();
    },
    leave() {
      clearInterval(ticking);
    },
  };
}
