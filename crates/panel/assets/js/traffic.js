// What clients and drives say to each other, decoded.

import { h, replace, setText } from "./dom.js";
import { follow } from "./net.js";
import * as store from "./store.js";

const MOST_ROWS = 5000;
const MOST_SHOWN = 400;
/** So near to its end counts as the end. */
const END_PX = 60;

/** Shows the traffic in `root`. */
export function mountTraffic(root) {
  let rows = [];
  let lost = 0;
  let paused = false;
  let stream = null;
  let due = false;
  const drive = h("select", { id: "traffic-drive", "aria-label": "Drive", onchange: () => listen() });
  const words = h("input", { type: "search", placeholder: "Filter, as in CMD or exception", "aria-label": "Filter the traffic", oninput: () => show() });
  const own = h("input", { type: "checkbox", id: "own", onchange: () => show() });
  const bad = h("input", { type: "checkbox", id: "bad", onchange: () => show() });
  const hex = h("input", { type: "checkbox", id: "hex", onchange: () => show() });
  const pause = h("button", { type: "button", id: "traffic-pause", "aria-pressed": "false", onclick: () => {
    paused = !paused;
    pause.setAttribute("aria-pressed", String(paused));
    setText(pause, paused ? "Go on" : "Pause");
    show();
  } }, "Pause");
  const tell = h("p", { class: "quiet", id: "traffic-state" });
  const body = h("tbody", {});
  const table = h("section", { class: "card scroll traffic", tabIndex: 0, "aria-label": "Conversation" }, h("table", {},
    h("thead", {}, h("tr", {}, ["Rig time", "Drive", "Client", "", "What is said"].map((head) => h("th", { scope: "col" }, head)))), body));
  replace(root, h("div", { class: "bar" }, h("h1", {}, "Traffic"), drive, words,
    h("label", { class: "row", for: "own" }, own, "this panel's too"), h("label", { class: "row", for: "bad" }, bad, "only refusals and errors"),
    h("label", { class: "row", for: "hex" }, hex, "bytes"), pause,
    h("button", { type: "button", onclick: () => { rows = []; lost = 0; show(); } }, "Empty"),
    h("button", { type: "button", id: "traffic-save", onclick: save }, "Save")),
    tell, table);

  const fits = (row) => {
    const wanted = words.value.trim().toLowerCase();
    return (own.checked || row.peer !== "panel") && (!bad.checked || row.bad) &&
      (!wanted || `${row.text} ${row.drive} ${row.peer} ${row.hex}`.toLowerCase().includes(wanted));
  };

  function show() {
    const found = rows.filter(fits);
    const last = found.slice(-MOST_SHOWN);
    // Who reads the end goes on reading it; who has scrolled up stays where they are.
    const atEnd = table.scrollTop + table.clientHeight > table.scrollHeight - END_PX;
    replace(body, last.map((row) => h("tr", { class: row.bad ? "bad-row" : "" },
      h("td", { class: "mono" }, (row.t_ns / 1e9).toFixed(6)),
      h("td", {}, row.drive),
      h("td", {}, `${row.by} #${row.conn}`, " ", h("small", {}, row.peer)),
      h("td", { class: `way ${row.to}` }, row.to === "drive" ? "→" : "←"),
      h("td", {}, row.text, hex.checked ? h("div", { class: "mono quiet" }, row.hex) : null))));
    if (atEnd) table.scrollTop = table.scrollHeight;
    setText(tell, `${found.length} of ${rows.length}${found.length > MOST_SHOWN ? `, the last ${MOST_SHOWN} shown` : ""}${lost ? `; ${lost} came too fast to be kept` : ""}${!own.checked && found.length === 0 && rows.length > 0 ? "; the others are this panel's own" : ""}${paused ? "; paused" : ""}`);
  }

  function listen() {
    stream?.close();
    const query = drive.value ? `?drive=${encodeURIComponent(drive.value)}` : "";
    stream = follow(`/v1/traffic${query}`, {
      traffic: (event) => {
        if (paused) return;
        rows.push(...event.rows);
        lost += event.lost ?? 0;
        if (rows.length > MOST_ROWS) rows = rows.slice(-MOST_ROWS);
        if (due) return;
        due = true;
        requestAnimationFrame(() => { due = false; show(); });
      },
    }, () => {}, 20_000);
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
  show();
  return () => {
    end();
    stream?.close();
  };
}
