// User programs of an SMSD: written, checked, simulated, stored, run and followed.

import { h, prose, replace, setText } from "./dom.js";
import { api, ofAxis } from "./net.js";
import * as store from "./store.js";
import { makeEditor } from "./editor.js";
import { mountTimeline } from "./timeline.js";

const CHECK_MS = 250;
const MEMS = [0, 1, 2, 3];
const FIRST = `; Goes to and fro five times.
    SET_MAX_SPEED 800
    RESET_POS
    LOOP_PROGRAM 5 {
        GO_TO 8000
        SET_WAIT 500ms
        GO_TO 0
    }
    END
`;

const kept = (name) => `stepdrive-program-${name}`;

/** Shows the programs of `context.axis` in `root`. */
export function mountPrograms(root, context) {
  const { axis } = context;
  let gone = false;
  let editor = null;
  /** What the checker said of the text as it is: `{diagnostics, mems}`. */
  let checked = null;
  /** The lines of the text that was stored or fetched, by memory, for as long as the text is that. */
  let stored = null;

  const place = h("div", {}, h("p", { class: "quiet" }, "Loading the language …"));
  const problems = h("ul", { class: "problems", "aria-label": "What the checker says" });
  const verdict = h("p", { id: "verdict", role: "status" });
  const state = h("span", { id: "program-state", role: "status" });
  const line = h("span", { class: "quiet number" });
  const timeline = h("section", { class: "card timeline", "aria-label": "Simulation", hidden: true });
  const mem = h("select", { id: "mem", "aria-label": "Memory" }, MEMS.map((number) => h("option", { value: String(number) }, `memory ${number}`)));
  const time = h("input", { id: "simulate-for", value: "60s", type: "text", autocomplete: "off", title: "How long to simulate" });
  const inputs = h("input", { id: "simulate-inputs", type: "text", placeholder: "IN0=at:2s", title: "Signals of the simulation, as IN0=at:2s IN1=on" });
  const file = h("input", { type: "file", accept: ".smsd,.txt,text/plain", hidden: true, onchange: async () => {
    const [chosen] = file.files;
    if (chosen) editor.text = await chosen.text();
    file.value = "";
  } });
  const button = (id, label, act, props = {}) => h("button", { type: "button", id, onclick: () => context.attempt(act), ...props }, label);

  replace(root, h("div", { class: "drive-page" },
    h("div", { class: "column" },
      h("section", { class: "card", "aria-label": "Program" },
        h("div", { class: "row spread" }, h("h2", {}, "Program"),
          h("div", { class: "row" },
            button("format", "Lay out", format, { class: "small" }),
            h("button", { type: "button", class: "small", onclick: () => file.click() }, "Open a file"), file, button("save", "Save as a file", save, { class: "small" }))),
        place, verdict, problems),
      timeline),
    h("div", { class: "column" },
      h("section", { class: "card", "aria-label": "In the drive" },
        h("h2", {}, "In the drive"), h("p", {}, state, " ", line),
        h("div", { class: "pair" }, button("store", "Store", storeAll, { class: "primary", title: "Stores every memory that the text has, and reads it back" }), button("fetch", "Fetch", fetchAll, { title: "Reads all four memories into the editor" })),
        h("div", { class: "pair" }, mem, button("start", "Start", start, { class: "moves" })),
        h("div", { class: "pair" }, h("small", {}, "as it was stored"), button("stop-program", "Stop program", stop)),
        h("p", { class: "quiet" }, "Stopping the program leaves the motor as it is; STOP above stops the motor.")),
      h("section", { class: "card", "aria-label": "Simulate" },
        h("h2", {}, "Simulate"),
        h("p", { class: "quiet" }, "On virtual time, on a drive that exists only for this: nothing moves."),
        h("div", { class: "ask" }, h("label", { for: "simulate-for" }, "for"), time, h("span", {})),
        h("div", { class: "ask" }, h("label", { for: "simulate-inputs" }, "inputs"), inputs, button("simulate", "Simulate", simulate))))));

  async function begin() {
    const language = await context.attempt(() => api("GET", "/v1/language"));
    if (!language || gone) return;
    const words = [
      ...language.instructions.map((one) => ({ name: one.name, about: one.about, kind: "instruction" })),
      ...language.instructions.filter((one) => one.alias).map((one) => ({ name: one.alias, about: one.about, kind: "instruction" })),
      ...language.inputs.map((name) => ({ name, about: "input", kind: "input" })),
      ...language.directives.map((one) => (typeof one === "string" ? { name: one, about: "", kind: "directive" } : { kind: "directive", ...one })),
    ];
    editor = makeEditor(place, words, changed);
    editor.text = localStorage.getItem(kept(axis.name)) ?? FIRST;
  }

  let timer;
  function changed(text) {
    localStorage.setItem(kept(axis.name), text);
    if (stored?.text !== text) stored = null;
    clearTimeout(timer);
    timer = setTimeout(() => check().catch((error) => setText(verdict, error.message)), CHECK_MS);
  }

  async function check() {
    const text = editor.text;
    const answer = await api("POST", "/v1/programs/check", { text, ...(axis.model ? { model: axis.model } : {}) });
    if (gone || editor.text !== text) return;
    checked = answer;
    editor.diagnose(answer.diagnostics);
    replace(problems, answer.diagnostics.map((one) => h("li", { class: one.severity },
      h("button", { type: "button", class: "plain small", onclick: () => editor.goTo(one.line, one.column) }, `${one.line}:${one.column}`),
      h("span", {}, h("strong", {}, one.severity), " ", prose(one.message), " ", one.help ? h("small", {}, prose(one.help)) : null))));
    const errors = answer.diagnostics.filter((one) => one.severity === "error").length;
    const sizes = answer.mems.filter((one) => one.size > 0).map((one) => `memory ${one.mem}: ${one.size} of 255`).join(", ");
    setText(verdict, errors ? `${errors} ${errors === 1 ? "error" : "errors"}` : `Good. ${sizes || "No instructions."}`);
    verdict.className = errors ? "error" : "good";
    for (const id of ["store", "simulate"]) root.querySelector(`#${id}`).disabled = errors > 0;
  }

  async function fetchAll() {
    const { text } = await api("GET", ofAxis(axis.name, "/programs"), undefined, { timeout: 30_000 });
    editor.text = text;
    await check();
    stored = { text, mems: checked.mems };
    context.notify("good", `Fetched the programs of ${axis.name}`);
  }

  async function format() {
    const { text } = await api("POST", "/v1/programs/format", { text: editor.text });
    editor.text = text;
  }

  function save() {
    const url = URL.createObjectURL(new Blob([editor.text], { type: "text/plain" }));
    h("a", { href: url, download: `${axis.name}.smsd` }).click();
    setTimeout(() => URL.revokeObjectURL(url), 1000);
  }

  async function storeAll() {
    const text = editor.text;
    await check();
    const answer = await api("PUT", ofAxis(axis.name, "/programs"), { text }, { timeout: 30_000 });
    stored = { text, mems: checked.mems };
    const what = answer.stored.map((one) => `${one.instructions} instructions in memory ${one.mem}`).join(", ");
    context.notify("good", `Stored and read back: ${what}`);
  }

  async function start() {
    await api("POST", ofAxis(axis.name, `/programs/${mem.value}/start`), {});
    context.notify("good", `The program in memory ${mem.value} runs`);
  }

  async function stop() {
    await api("POST", ofAxis(axis.name, "/programs/stop"), {});
  }

  async function simulate() {
    const pairs = inputs.value.trim().split(/\s+/).filter(Boolean).map((pair) => pair.split("="));
    const answer = await api("POST", "/v1/programs/simulate", {
      text: editor.text, mem: Number(mem.value), for: time.value.trim(), inputs: Object.fromEntries(pairs), axis: axis.name,
    }, { timeout: 15_000 });
    leaveTimeline();
    timeline.hidden = false;
    leaveTimeline = mountTimeline(timeline, answer, (line) => editor.goTo(line, 1), axis);
  }

  let leaveTimeline = () => {};
  const end = store.watch("focus", (now) => {
    const program = now.program;
    if (!program) return setText(state, "What the program does is not known.");
    const { running, mem: memory, line: at } = program;
    const runs = running === null ? "was last seen" : running ? "runs" : "stands";
    setText(state, `The program ${runs}`);
    setText(line, `at line ${at} of memory ${memory}.`);
    const lines = stored?.mems.find((one) => one.mem === memory)?.lines;
    editor?.run(running !== false && lines ? lines[at] ?? null : null);
    return undefined;
  });
  begin();
  return () => {
    gone = true;
    clearTimeout(timer);
    leaveTimeline();
    end();
  };
}
