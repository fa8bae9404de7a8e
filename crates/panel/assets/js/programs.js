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

/** So long after what runs could not be read it is tried again. */
const AGAIN_MS = 3000;

/** Under which names the browser keeps the text of a drive, and the text that is also kept elsewhere: in the drive, or as a file. */
const kept = (name) => `stepdrive-program-${name}`;
const safe = (name) => `stepdrive-program-safe-${name}`;

/** Shows the programs of `context.axis` in `root`. */
export function mountPrograms(root, context) {
  const { axis } = context;
  let gone = false;
  let editor = null;
  /** What the checker said last, and of which text: `{text, diagnostics, mems}`. */
  let checked = null;
  /** The instructions in the drive's memories, as they were read since the program that runs began. */
  const held = new Map();

  const place = h("div", {}, h("p", { class: "quiet" }, "Loading the language …"));
  const problems = h("ul", { class: "problems", "aria-label": "What the checker says" });
  const verdict = h("p", { id: "verdict", role: "status" });
  const state = h("span", { id: "program-state", role: "status" });
  const line = h("span", { class: "quiet number", id: "program-line" });
  const other = h("p", { id: "other-runs", role: "status", hidden: true }, h("span", {}, "It is not the text in the editor. "),
    h("button", { type: "button", class: "small", id: "show-running", onclick: () => context.attempt(fetchAll) }, "Show what runs"));
  const question = h("div", { class: "question", role: "alertdialog", "aria-label": "What was written is not stored", hidden: true });
  const timeline = h("section", { class: "card timeline", "aria-label": "Simulation", hidden: true });
  const mem = h("select", { id: "mem", "aria-label": "Memory" }, MEMS.map((number) => h("option", { value: String(number) }, `memory ${number}`)));
  const time = h("input", { id: "simulate-for", value: "60s", type: "text", autocomplete: "off", title: "How long to simulate" });
  const inputs = h("input", { id: "simulate-inputs", type: "text", placeholder: "IN0=at:2s", title: "Signals of the simulation, as IN0=at:2s IN1=on",
    "aria-describedby": "simulate-error" });
  const mistake = h("p", { class: "error", id: "simulate-error", role: "alert" });
  const file = h("input", { type: "file", accept: ".smsd,.txt,text/plain", hidden: true, onchange: async () => {
    const [chosen] = file.files;
    if (chosen) await put(await chosen.text());
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
        question, place, verdict, problems),
      timeline),
    h("div", { class: "column" },
      h("section", { class: "card", "aria-label": "In the drive" },
        h("h2", {}, "In the drive"), h("p", {}, state, " ", line), other,
        h("div", { class: "pair" }, button("store", "Store", storeAll, { class: "primary", title: "Stores every memory that the text has, and reads it back" }), button("fetch", "Fetch", fetchAll, { title: "Reads all four memories into the editor" })),
        h("div", { class: "pair" }, mem, button("start", "Start", start, { class: "moves" })),
        h("div", { class: "pair" }, h("small", {}, "as it was stored"), button("stop-program", "Stop program", stop)),
        h("p", { class: "quiet" }, "Stopping the program leaves the motor as it is; STOP above stops the motor.")),
      h("section", { class: "card", "aria-label": "Simulate" },
        h("h2", {}, "Simulate"),
        h("p", { class: "quiet" }, "On virtual time, on a drive that exists only for this: nothing moves."),
        h("div", { class: "ask" }, h("label", { for: "simulate-for" }, "for"), time, h("span", {})),
        h("div", { class: "ask" }, h("label", { for: "simulate-inputs" }, "inputs"), inputs, button("simulate", "Simulate", simulate)), mistake))));

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
    mark();
    clearTimeout(timer);
    timer = setTimeout(() => check().catch((error) => setText(verdict, error.message)), CHECK_MS);
  }

  /** Whether the text would be lost if another came in its place. */
  const isUnsaved = () => editor.text.trim() !== "" && editor.text !== (localStorage.getItem(safe(axis.name)) ?? FIRST);
  const saved = (text) => localStorage.setItem(safe(axis.name), text);

  /** Puts a text that is kept elsewhere in the place of the one in the editor, if nobody minds. Answers whether it did. */
  async function put(text) {
    const asks = editor.text !== text && isUnsaved();
    if (asks && !await agrees("What you wrote is not stored in the drive. Put the other text in its place? Ctrl+Z in the text brings it back.", "Put it in")) return false;
    if (gone) return false;
    editor.rewrite(text);
    saved(text);
    return true;
  }

  let settle = () => {};
  /** Asks, beside everything else: what asks must not keep a stop from coming through. */
  function agrees(words, yes) {
    settle(false);
    return new Promise((done) => {
      settle = (answer) => {
        question.hidden = true;
        done(answer);
      };
      const answer = (label, is, id) => h("button", { type: "button", class: "small", id, onclick: () => settle(is) }, label);
      replace(question, h("p", {}, words), h("div", { class: "row" }, answer(yes, true, "put-in"), answer("Keep mine", false, "keep-mine")));
      question.hidden = false;
      question.querySelector("#keep-mine").focus();
    });
  }

  const assemble = (text) => api("POST", "/v1/programs/check", { text, ...(axis.model ? { model: axis.model } : {}) });

  async function check() {
    const text = editor.text;
    const answer = await assemble(text);
    if (gone || editor.text !== text) return;
    checked = { text, ...answer };
    mark();
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

  /** Reads what the drive holds. Answers it as text, or null where it holds nothing. */
  async function readBack() {
    const { text } = await api("GET", ofAxis(axis.name, "/programs"), undefined, { timeout: 30_000 });
    const { mems } = await assemble(text);
    for (const memory of MEMS) held.set(memory, wordsOf(mems, memory));
    return mems.length > 0 ? text : null;
  }

  async function fetchAll() {
    const text = await readBack();
    if (text === null) return context.notify("error", `There are no programs in ${axis.name}; the text stays as it is`);
    if (!await put(text)) return undefined;
    await check();
    return context.notify("good", `Fetched the programs of ${axis.name}`);
  }

  async function format() {
    const before = editor.text;
    const wasSaved = !isUnsaved();
    const { text } = await api("POST", "/v1/programs/format", { text: before });
    // What was typed meanwhile is not laid out, and stays.
    if (gone || editor.text !== before) return;
    editor.rewrite(text);
    if (wasSaved) saved(text);
  }

  function save() {
    const url = URL.createObjectURL(new Blob([editor.text], { type: "text/plain" }));
    h("a", { href: url, download: `${axis.name}.smsd` }).click();
    setTimeout(() => URL.revokeObjectURL(url), 1000);
    saved(editor.text);
  }

  async function storeAll() {
    const text = editor.text;
    const answer = await api("PUT", ofAxis(axis.name, "/programs"), { text }, { timeout: 30_000 });
    saved(text);
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
    setText(mistake, "");
    let answer;
    try {
      answer = await api("POST", "/v1/programs/simulate", {
        text: editor.text, mem: Number(mem.value), for: time.value.trim(), inputs: signalsOf(inputs.value), axis: axis.name,
      }, { timeout: 15_000 });
    } catch (error) {
      return setText(mistake, error.message);
    }
    if (gone) return undefined;
    leaveTimeline();
    timeline.hidden = false;
    leaveTimeline = mountTimeline(timeline, answer, (line) => editor.goTo(line, 1), axis);
    return undefined;
  }

  let leaveTimeline = () => {};
  /** What the drive said of its program last, and whether what it holds is being read. */
  let program = null;
  let reading = false;
  let tryAt = 0;

  /** What runs may have been stored by anybody, so it is read whenever a program has begun. */
  async function lookWhatRuns() {
    if (reading || performance.now() < tryAt) return;
    reading = true;
    tryAt = performance.now() + AGAIN_MS;
    // It is not worth an error: the line is not marked meanwhile.
    await readBack().catch(() => {});
    reading = false;
    mark();
  }

  /** Whether the text in the editor is what runs; null while that is not known. */
  function isWhatRuns() {
    const words = held.get(program.mem);
    if (!words || !editor || checked?.text !== editor.text) return null;
    return words.join() === wordsOf(checked.mems, program.mem).join();
  }

  function mark() {
    if (gone || !program) return;
    const runs = program.running !== false;
    const is = runs ? isWhatRuns() : null;
    const at = is ? checked.mems.find((one) => one.mem === program.mem)?.lines[program.line] : undefined;
    setText(line, at ? `at line ${at}.` : `at instruction ${program.line} of memory ${program.mem}.`);
    other.hidden = !(program.running && is === false);
    editor?.run(at ?? null);
  }

  const end = store.watch("focus", (now) => {
    const before = program;
    program = now.program ?? null;
    if (!program) return setText(state, "What the program does is not known.");
    const { running } = program;
    const runs = running === null ? "was last seen" : running ? "runs" : "stands";
    setText(state, `The program ${runs}`);
    if (running && !before?.running) {
      held.clear();
      tryAt = 0;
    }
    if (running && !held.has(program.mem)) lookWhatRuns();
    return mark();
  });
  begin();
  return () => {
    gone = true;
    settle(false);
    clearTimeout(timer);
    leaveTimeline();
    end();
  };
}

/** The instructions of a memory, of all that the checker told. */
const wordsOf = (mems, memory) => mems.find((one) => one.mem === memory)?.words ?? [];

/** What is written of the inputs of a simulation, by their names. */
function signalsOf(text) {
  const signals = {};
  for (const word of text.split(/\s+/).filter(Boolean)) {
    const [, name, times] = /^([^=]+)=(.+)$/.exec(word) ?? [];
    if (!name) throw new Error(`“${word}” does not say what comes to which input; write it as in IN0=on or IN0=at:2s`);
    const input = name.toUpperCase();
    if (input in signals) throw new Error(`${input} is given twice; put its times together, as in ${input}=at:1s..2s,at:5s`);
    signals[input] = times;
  }
  return signals;
}
