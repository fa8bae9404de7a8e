// What clients and drives say to each other, decoded.

import { h, replace, setClass, setText } from "./dom.js";
import { follow } from "./net.js";
import * as store from "./store.js";

const MOST_ROWS = 5000;
const MOST_SHOWN = 400;
/** Who has scrolled up stays where they are, until so many are shown. */
const MOST_SHOWN_ABOVE = 2000;
/** So near to its end counts as the end. */
const END_PX = 60;
/** How often what came is shown: nobody reads faster, and the page has other things to do. */
const SHOW_MS = 100;

/** Shows the traffic in `root`. */
export function mountTraffic(root) {
  const drive = h("select", { id: "traffic-drive", "aria-label": "Drive", onchange: () => listen() });
  const words = h("input", { type: "search", placeholder: "Filter, as in CMD or exception", "aria-label": "Filter the traffic", oninput: () => rebuild() });
  const own = h("input", { type: "checkbox", id: "own", onchange: () => rebuild() });
  const bad = h("input", { type: "checkbox", id: "bad", onchange: () => rebuild() });
  const hex = h("input", { type: "checkbox", id: "hex", onchange: () => rebuild() });
  const pause = h("button", { type: "button", id: "traffic-pause", "aria-pressed": "false", onclick: () => hold(!paused) }, "Pause");
  const problem = h("p", { class: "error", id: "traffic-missing", role: "status" });
  const tell = h("p", { class: "quiet", id: "traffic-state" });
  const body = h("tbody", {});
  const view = h("section", { class: "card scroll traffic", tabIndex: 0, "aria-label": "Conversation" }, h("table", {},
    h("thead", {}, h("tr", {}, ["Rig time", "Drive", "Client", "", "What is said"].map((head) => h("th", { scope: "col" }, head)))), body));
  replace(root, h("div", { class: "bar" }, h("h1", {}, "Traffic"), drive, words,
    h("label", { class: "row", for: "own" }, own, "this panel's too"), h("label", { class: "row", for: "bad" }, bad, "only refusals and errors"),
    h("label", { class: "row", for: "hex" }, hex, "bytes"), pause,
    h("button", { type: "button", onclick: () => { rows = []; lost = 0; rebuild(); } }, "Empty"),
    h("button", { type: "button", id: "traffic-save", onclick: save }, "Save")),
    problem, tell, view);

  /** What is kept, how many of it fit the filter, and how many were not kept. */
  let rows = [];
  let fitting = 0;
  let lost = 0;
  /** What has come and is not shown yet; while it is paused, all that comes, up to as many as are kept. */
  let waiting = [];
  let dropped = 0;
  let paused = false;
  let atEnd = true;
  let due = null;
  let stream = null;
  view.addEventListener("scroll", () => { atEnd = view.scrollTop + view.clientHeight > view.scrollHeight - END_PX; });

  const fits = (row) => {
    const wanted = words.value.trim().toLowerCase();
    return (own.checked || row.peer !== "panel") && (!bad.checked || row.bad) &&
      (!wanted || `${row.text} ${row.drive} ${row.peer} ${row.hex}`.toLowerCase().includes(wanted));
  };

  const line = (row) => h("tr", { class: row.bad ? "bad-row" : "" },
    h("td", { class: "mono" }, (row.t_ns / 1e9).toFixed(6)),
    h("td", {}, row.drive),
    h("td", {}, `${row.by} #${row.conn}`, " ", h("small", {}, row.peer)),
    h("td", { class: `way ${row.to}` }, row.to === "drive" ? "→" : "←"),
    h("td", {}, row.text, hex.checked ? h("div", { class: "mono quiet" }, row.hex) : null));

  /** Shows all that is kept and fits, anew. */
  function rebuild() {
    const found = rows.filter(fits);
    fitting = found.length;
    replace(body, found.slice(-MOST_SHOWN).map(line));
    toEnd();
    count();
  }

  /** Takes what waits, and shows it below what is there. */
  function append() {
    due = null;
    if (paused) return;
    const come = waiting;
    waiting = [];
    rows = rows.concat(come);
    const found = come.filter(fits);
    fitting += found.length;
    if (rows.length > MOST_ROWS) fitting -= rows.splice(0, rows.length - MOST_ROWS).filter(fits).length;
    body.append(...found.slice(-MOST_SHOWN).map(line));
    trim(atEnd ? MOST_SHOWN : MOST_SHOWN_ABOVE);
    if (found.length > 0 && atEnd) toEnd();
    count();
  }

  function trim(most) {
    if (body.children.length <= most) return;
    const rest = document.createRange();
    rest.setStartBefore(body.firstChild);
    rest.setEndBefore(body.children[body.children.length - most]);
    rest.deleteContents();
  }

  function toEnd() {
    view.scrollTop = view.scrollHeight;
    atEnd = true;
  }

  function count() {
    const told = [`${fitting} of ${rows.length}`];
    if (fitting > body.children.length) told.push(`, the last ${body.children.length} shown`);
    if (lost) told.push(`; ${lost} were not kept`);
    if (!own.checked && fitting === 0 && rows.length > 0) told.push("; the others are this panel's own");
    if (paused) told.push(`; paused: ${waiting.length} wait${dropped ? `, and ${dropped} before them were dropped` : ""}`);
    setText(tell, told.join(""));
  }

  function hold(on) {
    paused = on;
    pause.setAttribute("aria-pressed", String(on));
    setText(pause, on ? "Resume" : "Pause");
    if (!on) {
      lost += dropped;
      dropped = 0;
      append();
    }
    count();
  }

  function take(event) {
    lost += event.lost ?? 0;
    for (const row of event.rows) waiting.push(row);
    if (waiting.length > 1.2 * MOST_ROWS) dropped += waiting.splice(0, waiting.length - MOST_ROWS).length;
    due ??= setTimeout(paused ? recount : append, SHOW_MS);
  }

  function recount() {
    due = null;
    count();
  }

  function link(up, error) {
    if (up) setText(problem, "");
    else if (error?.status) setText(problem, `What is said cannot be followed: ${error.message}`);
    else if (!problem.textContent) setText(problem, "The server is not heard; what is said meanwhile is missing here.");
    setClass(view, "stale", !up);
  }

  function listen() {
    stream?.close();
    const query = drive.value ? `?drive=${encodeURIComponent(drive.value)}` : "";
    stream = follow(`/v1/traffic${query}`, { traffic: take }, link, 20_000);
  }

  function save() {
    const text = rows.filter(fits).map((row) => JSON.stringify(row)).join("\n");
    const url = URL.createObjectURL(new Blob([`${text}\n`], { type: "application/jsonl" }));
    h("a", { href: url, download: "traffic.jsonl" }).click();
    setTimeout(() => URL.revokeObjectURL(url), 1000);
  }

  const names = () => replace(drive, h("option", { value: "" }, "all drives"),
    store.axes.filter((axis) => axis.virtual).map((axis) => h("option", { value: axis.name, selected: axis.name === drive.value }, axis.name)));
  const end = store.watch("axes", names);
  names();
  listen();
  rebuild();
  return () => {
    end();
    clearTimeout(due);
    stream?.close();
  };
}
