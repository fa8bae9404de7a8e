// An editor for user programs: highlighting, completion, and what the checker says at its place.
//
// It is a text area, which brings undo, selection, touch and screen readers with it, over a picture of the same text in
// colours.

import { h, prose, replace } from "./dom.js";

const TOKEN = /(;[^\n]*)|(\.[A-Za-z_]\w*)|([A-Za-z_][\w]*)(?=\s*:)|([A-Za-z_]\w*)|([-+]?(?:0x[0-9A-Fa-f_]+|1\/\d+|\d[\d_]*(?:\.\d+)?(?:ms|min|mA|s|h|A|%)?))|([{}|=:])/g;

/** An editor in `root`. `words` are `{name, about, kind}` for completion; `onChange(text)` is called as it is written. */
export function makeEditor(root, words, onChange) {
  const known = new Map(words.map((word) => [word.name.toUpperCase(), word]));
  const area = h("textarea", { class: "code", id: "program-text", spellcheck: false, autocomplete: "off", "aria-label": "Program", wrap: "off",
    "aria-describedby": "editor-help", rows: 18 });
  area.setAttribute("autocapitalize", "off");
  const picture = h("pre", { class: "code picture", "aria-hidden": "true" });
  const gutter = h("div", { class: "gutter", "aria-hidden": "true" });
  const popup = h("ul", { class: "popup", role: "listbox", id: "completions", hidden: true, "aria-label": "Completions" });
  const sheet = h("div", { class: "sheet" }, picture, area, popup);
  replace(root, h("div", { class: "editor" }, gutter, sheet),
    h("small", { id: "editor-help" }, "Ctrl+Space completes. Tab indents; Escape stops the drive, and then Tab leaves the editor."));

  let diagnostics = [];
  let running = null;
  let escaped = false;

  function paint() {
    const lines = area.value.split("\n");
    const marks = new Map();
    for (const one of diagnostics) {
      if (!marks.has(one.line) || one.severity === "error") marks.set(one.line, one);
    }
    replace(picture, lines.map((line, at) => h("span", { class: lineClass(at + 1, marks) }, colour(line, diagnostics.filter((one) => one.line === at + 1)), "\n")));
    replace(gutter, lines.map((_, at) => {
      const mark = marks.get(at + 1);
      const kind = running === at + 1 ? "running" : mark?.severity ?? "";
      return h("span", { class: kind, title: mark?.message }, running === at + 1 ? "▶" : mark ? "●" : "", String(at + 1).padStart(3, " "));
    }));
    area.style.height = `${Math.max(18, lines.length + 1) * 1.5}em`;
    scroll();
  }

  const lineClass = (number, marks) => `line${running === number ? " running" : ""}${marks.has(number) ? ` ${marks.get(number).severity}` : ""}`;

  function colour(line, found) {
    const parts = [];
    let at = 0;
    const plain = (to) => { if (to > at) parts.push(line.slice(at, to)); };
    for (const match of line.matchAll(TOKEN)) {
      plain(match.index);
      at = match.index + match[0].length;
      const bad = found.some((one) => match.index + 1 < endOf(one, line) && at + 1 > one.column);
      parts.push(h("span", { class: `${kindOf(match)}${bad ? " bad" : ""}` }, match[0]));
    }
    plain(line.length);
    return parts;
  }

  const endOf = (one, line) => (one.end_line > one.line ? line.length + 1 : Math.max(one.end_column, one.column + 1));

  function kindOf(match) {
    const [, comment, directive, label, word, number] = match;
    if (comment) return "t-comment";
    if (directive) return "t-directive";
    if (label) return /^mem\d$/i.test(label) ? "t-word" : "t-label";
    if (word) return `t-${known.get(word.toUpperCase())?.kind ?? "word"}`;
    return number ? "t-number" : "t-sign";
  }

  const scroll = () => {
    picture.scrollLeft = area.scrollLeft;
  };

  /* Completion. */

  let choices = [];
  let chosen = 0;
  const wordBefore = () => /[.\w]*$/.exec(area.value.slice(0, area.selectionStart))[0];

  function complete(asked) {
    const begun = wordBefore().toUpperCase();
    choices = begun || asked ? words.filter((word) => word.name.toUpperCase().startsWith(begun) && word.name.toUpperCase() !== begun).slice(0, 12) : [];
    if (choices.length === 0 || (!asked && begun.length < 2)) return hide();
    chosen = 0;
    const before = area.value.slice(0, area.selectionStart).split("\n");
    popup.style.top = `calc(${before.length} * 1.5em + .5rem)`;
    popup.style.left = `calc(${before.at(-1).length - begun.length} * 1ch + .6rem)`;
    showChoices();
    return undefined;
  }

  function showChoices() {
    replace(popup, choices.map((word, at) => h("li", { role: "option", id: `choice-${at}`, class: at === chosen ? "chosen" : "", "aria-selected": at === chosen,
      onpointerdown: (event) => { event.preventDefault(); chosen = at; take(); } }, h("code", {}, word.name), " ", h("small", {}, prose(word.about ?? "")))));
    popup.hidden = false;
    area.setAttribute("aria-activedescendant", `choice-${chosen}`);
  }

  function hide() {
    popup.hidden = true;
    area.removeAttribute("aria-activedescendant");
  }

  function take() {
    const begun = wordBefore();
    area.setSelectionRange(area.selectionStart - begun.length, area.selectionStart);
    insert(choices[chosen].name);
    hide();
  }

  /** Puts text in as if it had been typed, so that it can be undone. */
  function insert(text) {
    area.focus({ preventScroll: true });
    const done = text ? document.execCommand("insertText", false, text) : document.execCommand("delete");
    if (!done) {
      area.setRangeText(text, area.selectionStart, area.selectionEnd, "end");
      area.dispatchEvent(new Event("input"));
    }
  }

  area.addEventListener("keydown", (event) => {
    if (!popup.hidden) {
      const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
      if (step) {
        event.preventDefault();
        chosen = (chosen + step + choices.length) % choices.length;
        return showChoices();
      }
      if (event.key === "Enter" || event.key === "Tab") {
        event.preventDefault();
        return take();
      }
      if (event.key === "Escape") return hide();
    }
    if (event.key === " " && event.ctrlKey) {
      event.preventDefault();
      return complete(true);
    }
    if (event.key === "Tab" && !event.shiftKey && !escaped) {
      event.preventDefault();
      insert("    ");
    }
    escaped = event.key === "Escape";
    return undefined;
  });
  area.addEventListener("input", () => {
    paint();
    complete(false);
    onChange(area.value);
  });
  area.addEventListener("blur", hide);
  area.addEventListener("scroll", scroll);
  paint();

  return {
    get text() { return area.value; },
    set text(value) {
      area.value = value;
      diagnostics = [];
      paint();
      onChange(value);
    },
    /** Puts a text in the place of all that stands there as if it had been typed: it can be undone. Who was elsewhere stays there. */
    rewrite(value) {
      if (area.value === value) return;
      const before = document.activeElement;
      area.focus({ preventScroll: true });
      area.select();
      insert(value);
      hide();
      if (before === area) return;
      area.blur();
      before?.focus({ preventScroll: true });
    },
    /** Shows what the checker says. */
    diagnose(found) {
      diagnostics = found;
      paint();
    },
    /** Highlights the line that runs; null for none. */
    run(line) {
      if (running === line) return;
      running = line;
      paint();
    },
    /** Goes to a place in the text. */
    goTo(line, column) {
      const lines = area.value.split("\n");
      const at = lines.slice(0, line - 1).reduce((sum, text) => sum + text.length + 1, 0) + column - 1;
      area.focus();
      area.setSelectionRange(at, at);
    },
  };
}
