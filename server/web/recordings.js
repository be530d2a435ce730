// The list of recordings: searched, filtered, chosen for an overlay; files are imported by drag or by choosing them.
import { byId, bytes, count, duration, element, loadText, moment } from "./dom.js";
import { clearErrors, showError } from "./errors.js";

const kind = (status) => (status === "complete" ? "good" : ["running", "recovered"].includes(status) ? "" : "wrong");

export class Recordings {
  // open(names): shows one or several; changed(): the list has been read again
  constructor(rpc, open, changed) {
    this.rpc = rpc;
    this.open = open;
    this.changed = changed;
    this.list = [];
    this.chosen = new Set();
    for (const id of ["recording-search", "recording-status"]) byId(id).addEventListener("input", () => this.#show());
    byId("overlay").addEventListener("click", () => this.open([...this.chosen]));
    byId("import-file").addEventListener("change", (event) => this.#importAll(event.target.files));
    const zone = byId("recordings");
    zone.addEventListener("dragover", (event) => {
      event.preventDefault();
      zone.dataset.drag = true;
    });
    zone.addEventListener("dragleave", (event) => zone.contains(event.relatedTarget) || delete zone.dataset.drag);
    zone.addEventListener("drop", (event) => {
      event.preventDefault();
      delete zone.dataset.drag;
      this.#importAll(event.dataTransfer.files);
    });
  }

  async refresh() {
    try {
      this.list = (await this.rpc.call("recording.list")).recordings;
      this.#show();
      this.changed();
    } catch (error) {
      showError("The list of recordings could not be read.", error);
    }
  }

  mark(names) {
    this.shown = names;
    for (const item of byId("recording-list").children)
      if (names.includes(item.dataset.name)) item.setAttribute("aria-current", "true");
      else item.removeAttribute("aria-current");
  }

  #show() {
    const words = byId("recording-search").value.toLowerCase().split(/\s+/).filter(Boolean);
    const status = byId("recording-status").value;
    const text = (r) => [r.name, r.title, r.protocol, r.model, r.device, r.start_time, r.reason, loadText(r)].join(" ").toLowerCase();
    const found = this.list.filter((r) => (!status || r.status === status) && words.every((w) => text(r).includes(w)));
    byId("recording-none").hidden = found.length > 0;
    byId("recording-none").textContent = this.list.length ? "None of them fits." : "None yet: every run leaves one here, and files can be dropped here.";
    byId("recording-count").textContent = this.list.length ? `${found.length} of ${this.list.length}` : "";
    byId("recording-list").replaceChildren(...found.map((r) => this.#item(r)));
    this.mark(this.shown ?? []);
    this.#chose();
  }

  #item(r) {
    const about = r.title || r.name;
    const box = element("input", { type: "checkbox", "aria-label": `Choose ${about}, ${moment(r.start_time)}`, onchange: () => {
      if (box.checked) this.chosen.add(r.name);
      else this.chosen.delete(r.name);
      this.#chose();
    } });
    box.checked = this.chosen.has(r.name);
    return element("li", { "data-name": r.name }, box,
      element("div", { class: "about" }, element("a", { href: `#recordings/${encodeURIComponent(r.name)}` }, about),
        element("p", { class: "note" }, r.rows ? `${moment(r.start_time)} · ${duration(r.duration_s)} · ${count(r.rows)} samples · ${bytes(r.bytes)}` : moment(r.start_time)),
        element("p", { class: "note" }, element("span", { class: kind(r.status) }, r.reason ? `${r.status}: ${r.reason}` : r.status), ...[loadText(r), r.model && `model ${r.model}`].filter(Boolean).map((t) => ` · ${t}`))),
      element("a", { class: "small button", href: `/recordings/${encodeURIComponent(r.name)}`, download: `${r.name}.h5`, "aria-label": `Download ${r.name}` }, "HDF5"));
  }

  #chose() {
    byId("overlay").disabled = this.chosen.size < 2;
    byId("overlay").textContent = this.chosen.size > 1 ? `Overlay ${this.chosen.size}` : "Overlay";
  }

  async #importAll(files) {
    for (const file of files) await this.#import(file);
    byId("import-file").value = "";
  }

  async #import(file) {
    const name = file.name.replace(/\.[^.]*$/, "").replace(/[^A-Za-z0-9._-]/g, "-").replace(/^\.+/, "") || "import";
    const set = {};
    for (const input of document.querySelectorAll("[data-import]")) {
      const value = Number(input.value.replace(",", "."));
      if (input.value.trim() !== "") set[input.dataset.import] = Number((value * Number(input.dataset.scale)).toPrecision(15));
    }
    try {
      clearErrors();
      const buffer = await file.arrayBuffer();
      let text;
      try {
        text = new TextDecoder("utf-8", { fatal: true }).decode(buffer);
      } catch {
        text = new TextDecoder("windows-1252").decode(buffer);
      }
      const answer = await this.rpc.call("recording.import", { name, csv: text, ...set });
      await this.refresh();
      byId("import-findings").replaceChildren(...answer.findings.map((f) => element("li", {}, element("strong", {}, f.kind), " ", f.message)));
      location.hash = `#recordings/${encodeURIComponent(answer.recordings[0].name)}`;
    } catch (error) {
      if (error.problems?.some((p) => /area|thickness|length/.test(p.path ?? ""))) byId("import-details").open = true;
      showError(`${file.name} was not imported.`, error);
    }
  }
}
