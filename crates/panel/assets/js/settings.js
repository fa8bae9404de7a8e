// Every register and parameter, as the tables have them: edited, checked, applied and read back.

import { h, prose, replace, setClass, setText } from "./dom.js";
import { api, ofAxis } from "./net.js";
import * as store from "./store.js";

/** So long after a change elsewhere the settings are read again: changes seldom come alone. */
const SOON_MS = 300;
/** What a person has changed and not applied, by name of the drive: the text by setting, and what stood there before. */
const drafts = new Map();
/** Shows the settings of `context.axis` in `root`. */
export function mountSettings(root, context) {
  const { axis } = context;
  const withFlash = axis.family === "smd3";
  let rows = [];
  let gone = false;
  const edits = drafts.get(axis.name) ?? new Map();
  drafts.set(axis.name, edits);
  const fields = new Map();
  const search = h("input", { type: "search", placeholder: "Filter by name or meaning", "aria-label": "Filter settings", oninput: () => filter() });
  const only = h("input", { type: "checkbox", id: "only-changed", onchange: () => filter() });
  const apply = h("button", { type: "button", class: "primary", id: "apply", disabled: true, onclick: () => send() }, "Apply and verify");
  const discard = h("button", { type: "button", id: "discard", disabled: true, onclick: () => { edits.clear(); show(); } }, "Discard");
  const again = h("button", { type: "button", id: "read-again", title: "Reads the settings from the drive", onclick: () => load() }, "Read again");
  const read = h("small", { id: "settings-read", role: "status" });
  const report = h("div", { class: "report", id: "report" });
  const body = h("div", { class: "settings" });
  replace(root,
    h("section", { class: "card" },
      h("div", { class: "bar settings-bar" }, h("h2", {}, "Settings"), search,
        h("label", { class: "row", for: "only-changed" }, only, "Only what differs"),
        h("span", { class: "grow" }), again, ...memory(), discard, apply),
      read, report, body));

  /** What keeps the settings through power-off, by family. */
  function memory() {
    const act = (rest, label, title, good) => h("button", { type: "button", title, onclick: async () => {
      if (await context.attempt(() => api("POST", ofAxis(axis.name, rest), {})) === undefined) return;
      context.notify("good", good);
      load();
    } }, label);
    if (axis.family === "smsd") {
      return [act("/settings/apply-lan", "Apply LAN parameters", "Puts the LAN parameters into effect; the controller closes its connections", "The LAN parameters are in effect")];
    }
    return [
      act("/settings/store", "Store", "STORE: keeps the settings through power-off", "The settings are stored"),
      act("/settings/load", "Load", "LOAD: takes the stored settings back", "The stored settings are in force"),
    ];
  }

  let loading = false;
  let anew = false;
  /** Reads the settings; what is asked for meanwhile is done after that, once. */
  async function load() {
    anew = true;
    if (loading) return;
    loading = true;
    while (anew && !gone) {
      anew = false;
      try {
        take((await api("GET", ofAxis(axis.name, "/settings"))).rows);
        setText(read, "");
      } catch (error) {
        setText(read, `They could not be read: ${error.message}`);
      }
      setClass(read, "error", read.textContent);
    }
    loading = false;
  }

  function take(found) {
    if (gone || JSON.stringify(found) === JSON.stringify(rows)) return;
    rows = found;
    show();
  }

  function show() {
    const back = keepPlace();
    fields.clear();
    const groups = new Map();
    for (const row of rows) groups.set(row.group, [...(groups.get(row.group) ?? []), row]);
    replace(body, [...groups].map(([name, members]) => h("section", { class: "group" },
      h("h3", {}, name),
      h("div", { class: "scroll" }, h("table", { class: withFlash ? "with-flash" : "" },
        h("thead", {}, h("tr", {}, ["Setting", "Value", "Range", "Default", withFlash ? "Stored" : null, "What it is"].filter(Boolean).map((head) =>
          h("th", { scope: "col", title: head === "Stored" ? NOT_TOLD : null }, head)))),
        h("tbody", {}, members.map(line)))))));
    filter();
    update();
    back();
  }

  /** Remembers where a person types. Answers what brings them back there. */
  function keepPlace() {
    const { id, selectionStart, selectionEnd } = document.activeElement;
    if (!body.contains(document.activeElement)) return () => {};
    return () => {
      const field = document.getElementById(id);
      field?.focus({ preventScroll: true });
      if (field?.type === "text") field.setSelectionRange(selectionStart, selectionEnd);
    };
  }

  function line(row) {
    const id = `set-${row.name.replace(/[^A-Za-z0-9]/g, "-")}`;
    const field = control(row, id);
    const error = h("small", { class: "error", id: `${id}-error`, role: "alert" });
    const elsewhere = h("small", { class: "elsewhere", id: `${id}-elsewhere`, role: "status" });
    field.setAttribute("aria-describedby", `${error.id} ${elsewhere.id}`);
    field.addEventListener("input", () => { note(row, field, error, elsewhere); update(); });
    if (edits.has(row.name)) put(field, edits.get(row.name).text);
    const element = h("tr", {},
      h("th", { scope: "row" }, h("label", { for: id, class: "mono" }, row.name)),
      h("td", {}, h("span", { class: "row" }, field, h("small", {}, row.unit)), error, elsewhere,
        row.writable ? null : h("small", {}, row.why_not ?? "read only"), row.volatile ? h("small", { class: "block" }, "lost at power-off") : null),
      h("td", { class: "mono range" }, rangeOf(row)),
      h("td", { class: "mono default" }, told(row, row.default)),
      withFlash ? h("td", { class: "mono stored" }, known(row.stored) ? told(row, row.stored) : h("span", { title: NOT_TOLD }, "?")) : null,
      h("td", {}, prose(row.about), " ", h("small", {}, row.source)));
    fields.set(row.name, { row, field, error, element });
    note(row, field, error, elsewhere);
    return element;
  }

  function note(row, field, error, elsewhere) {
    const text = got(field);
    if (text === given(row)) edits.delete(row.name);
    else edits.set(row.name, { text, from: edits.get(row.name)?.from ?? given(row) });
    const edit = edits.get(row.name);
    const why = edit ? objection(row, text) : "";
    setText(error, why);
    setText(elsewhere, edit && edit.from !== given(row) ? `changed elsewhere to ${told(row, row.value)}` : "");
    field.setAttribute("aria-invalid", String(Boolean(why)));
    const element = field.closest("tr") ?? fields.get(row.name)?.element;
    if (element) {
      setClass(element, "edited", edits.has(row.name));
      mark(element, row);
    }
  }

  function mark(element, row) {
    setClass(element, "differs", differs(row));
    setClass(element, "unstored", known(row.stored) && known(row.value) && !alike(row.stored, row.value));
  }

  function update() {
    const mine = editsHere();
    apply.disabled = mine.length === 0 || mine.some(([name, { text }]) => objection(fields.get(name).row, text));
    discard.disabled = edits.size === 0;
    setText(apply, mine.length > 0 ? `Apply and verify ${mine.length}` : "Apply and verify");
    for (const { row, element } of fields.values()) mark(element, row);
  }

  /** The edits of settings that the drive told: it may not always tell all. */
  const editsHere = () => [...edits].filter(([name]) => fields.has(name));

  function filter() {
    const wanted = search.value.trim().toLowerCase();
    for (const { row, element } of fields.values()) {
      const fits = !wanted || `${row.name} ${row.about}`.toLowerCase().includes(wanted);
      element.hidden = !fits || (only.checked && !element.matches(".differs, .unstored, .edited"));
    }
    for (const group of body.children) group.hidden = ![...group.querySelectorAll("tbody tr")].some((row) => !row.hidden);
  }

  async function send() {
    const set = Object.fromEntries(editsHere().map(([name, { text }]) => [name, valueOf(fields.get(name).row, text)]));
    replace(report, "Applying …");
    try {
      const answer = await api("PUT", ofAxis(axis.name, "/settings"), { set });
      edits.clear();
      await load();
      show();
      tell(answer);
    } catch (error) {
      replace(report, h("p", { class: "error" }, error.message));
      context.notify("error", error.message);
      for (const [name, why] of Object.entries(error.body?.fields ?? {})) {
        const at = fields.get(name);
        if (!at) continue;
        setText(at.error, why);
        at.field.setAttribute("aria-invalid", "true");
      }
    }
  }

  function tell({ changed, differs: differing }) {
    const done = changed.map((row) => h("li", {}, h("code", {}, row.name), ` ${row.from} → ${row.to}, reads ${row.reads}`));
    const other = differing.map((row) => h("li", { class: "error" }, h("code", {}, row.name), ` was to be ${row.wanted} and reads ${row.reads}`));
    const summary = other.length ? "Applied, but not all reads back as it was written" : `Applied and read back: ${changed.length} changed`;
    replace(report, h("p", {}, summary), h("ul", {}, done, other));
    context.notify(other.length ? "error" : "good", summary);
  }

  let timer;
  const soon = () => {
    clearTimeout(timer);
    // A page that is not seen reads when it is looked at again.
    if (!document.hidden) timer = setTimeout(load, SOON_MS);
  };
  let before = null;
  const end = store.watch("focus", (now) => {
    if (now.b & (store.BIT.LOST | store.BIT.UNREAD)) return;
    // What can be set depends on what the motor does.
    const is = [now.rev, now.b & (store.BIT.ENERGISED | store.BIT.MOVING), now.flags?.STANDBY].join();
    if (before !== null && before !== is) soon();
    before = is;
  });
  document.addEventListener("visibilitychange", soon);
  load();
  return () => {
    gone = true;
    clearTimeout(timer);
    document.removeEventListener("visibilitychange", soon);
    end();
  };
}

/** The control that a setting is edited with. */
function control(row, id) {
  const common = { id, disabled: !row.writable };
  if (row.kind === "bool") return h("input", { ...common, type: "checkbox", checked: Boolean(row.value) });
  if (row.kind === "choice") {
    return h("select", common, row.choices.map((choice) =>
      h("option", { value: String(choice.value), selected: String(choice.value) === String(row.value) }, `${choice.value} – ${choice.name}`)));
  }
  return h("input", { ...common, type: "text", inputMode: row.kind === "text" ? "text" : "decimal", autocomplete: "off", spellcheck: false, value: given(row), size: 12 });
}

const got = (field) => (field.type === "checkbox" ? String(field.checked) : field.value.trim());
const put = (field, text) => {
  if (field.type === "checkbox") field.checked = text === "true";
  else field.value = text;
};
const given = (row) => (row.kind === "bool" ? String(Boolean(row.value)) : row.value === null || row.value === undefined ? "" : String(row.value));
const valueOf = (row, text) => (row.kind === "bool" ? text === "true" : row.kind === "text" ? text : Number(text));

const NOT_TOLD = "As it was last stored or loaded by this server. The drive does not tell what its flash holds.";
const known = (value) => value !== null && value !== undefined;
const alike = (one, other) => String(Number(one)) === String(Number(other)) || String(one) === String(other);

function told(row, value) {
  if (value === null || value === undefined) return "–";
  if (row.kind === "bool") return Number(value) ? "on" : "off";
  const choice = row.choices?.find((known) => String(known.value) === String(value));
  return choice ? `${value} (${choice.name})` : String(value);
}

function rangeOf(row) {
  if (row.kind === "bool") return "on, off";
  if (row.min === null || row.min === undefined) return "";
  return `${row.min} to ${row.max}`;
}

/** Whether it is not what the controller had from its maker, as the controller rounds that. */
const differs = (row) => row.at_default === false;

const OCTET = /^(0|[1-9]\d{0,2})$/;
const isAddress = (text) => {
  const octets = text.split(".");
  return octets.length === 4 && octets.every((octet) => OCTET.test(octet) && Number(octet) <= 255);
};

/** Why a text cannot be the value of a setting; empty when it can. */
function objection(row, text) {
  if (!row.writable) return row.why_not ?? "it cannot be set now";
  if (row.kind === "text" && isAddress(String(row.value)) && !isAddress(text)) return "four numbers from 0 to 255 with dots between, as in 192.168.1.2";
  if (row.kind === "bool" || row.kind === "text" || row.kind === "choice") return "";
  const value = Number(text);
  if (text === "" || !Number.isFinite(value)) return "a number, please";
  if (row.kind === "integer" && !Number.isInteger(value)) return "a whole number, please";
  if (row.min !== null && row.min !== undefined && (value < row.min || value > row.max)) return `${row.min} to ${row.max}${row.unit ? ` ${row.unit}` : ""}`;
  return "";
}
