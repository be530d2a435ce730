// A model beside a measurement: simulated on it with the residual below, fitted to it, and searched for what it misses.
import { Chart, TimeGroup, colour, download, kindColour } from "./chart.js";
import { button, byId, element, facts, interval, number, shownChannels, timeAxis } from "./dom.js";
import { clearErrors, showError } from "./errors.js";
import { reportTable } from "./tables.js";

const column = (key, title, unit = "") => ({ key, title, unit });
const percent = (share) => (share === null || share === undefined ? "–" : `${number(share * 100, 3)} %`);
const names = (effects) => effects.map((e) => e.id ?? e.name ?? e).map((n) => String(n).replaceAll("_", " ")).join(" + ");

export class ModelView {
  // load(protocol): shows it under Experiment
  constructor(rpc, jobs, { recordings, load }) {
    Object.assign(this, { rpc, jobs, recordings, load });
    this.charts = [];
    for (const [id, act] of [["simulate-form", () => this.#simulate()], ["fit-form", () => this.#fit()], ["discover-form", () => this.#discover()]])
      byId(id).addEventListener("submit", (event) => {
        event.preventDefault();
        act();
      });
  }

  async refresh() {
    const { models, default: usual } = await this.rpc.call("model.list");
    for (const select of document.querySelectorAll("select[data-models]")) {
      const chosen = select.value || usual;
      const own = select.dataset.models === "own" ? [element("option", { value: "" }, "the recording's own")] : [];
      select.replaceChildren(...own, ...models.filter((m) => !m.error).map((m) => element("option", { value: m.name }, m.title && m.title !== m.name ? `${m.name}: ${m.title}` : m.name)));
      select.value = select.dataset.models === "own" && !select.dataset.touched ? "" : chosen;
    }
    this.showRecordings();
  }

  showRecordings() {
    const list = this.recordings();
    const options = () => list.filter((r) => r.rows).map((r) => element("option", { value: r.name }, r.title ? `${r.title} (${r.name})` : r.name));
    for (const select of document.querySelectorAll("select[data-recordings]")) {
      const chosen = new Set([...select.selectedOptions].map((o) => o.value));
      select.replaceChildren(...options());
      for (const option of select.options) option.selected = chosen.has(option.value) || (!select.multiple && option.value === this.wanted);
    }
  }

  async show(recording) {
    this.wanted = recording;
    await this.refresh().catch((error) => showError("The models could not be read.", error));
  }

  async #run(form, failure, start, done) {
    const submit = byId(form).querySelector("button");
    submit.disabled = true;
    try {
      clearErrors();
      const job = await start();
      await done((await this.jobs.follow(job, byId(form).querySelector(".job-place"))).result);
    } catch (error) {
      byId(form).querySelector(".job-place").replaceChildren();
      showError(failure, error);
    } finally {
      submit.disabled = false;
    }
  }

  #simulate() {
    const recording = byId("simulate-recording").value;
    return this.#run("simulate-form", "It was not simulated.",
      () => this.rpc.call("model.simulate", { recording, model: byId("simulate-model").value || undefined }),
      async (result) => this.#overlay(recording, result));
  }

  // Measured and simulated over each other, and below each channel what the model does not explain.
  async #overlay(measured, { recording, time_error, quadrature_error }) {
    for (const chart of this.charts) chart.remove();
    this.charts = [];
    const read = (name) => this.rpc.call("recording.read", { name, max_points: 3000 });
    const [info, a, b, difference] = await Promise.all([this.rpc.call("recording.info", { name: measured }), read(measured), read(recording),
      this.rpc.call("recording.compare", { a: measured, b: recording })]);
    const place = byId("simulate-result");
    const plots = element("div", { class: "series-charts" });
    place.replaceChildren(element("p", { class: "note" }, "Simulation: ", element("a", { href: `#recordings/${encodeURIComponent(recording)}` }, recording),
      `; its own error: time steps ${number(time_error, 2)}, quadrature ${number(quadrature_error, 2)} of the range. Drag to zoom, double click for all.`), plots);
    const group = new TimeGroup();
    const rows = [];
    for (const channel of shownChannels(info.specimen)) {
      if (channel.key === "field" || !a[channel.key] || !b[channel.key]) continue;
      const over = new Chart(plots, { title: channel.title, x: timeAxis, y: channel, group, height: 170, legend: true, about: () => recording });
      over.set([{ name: "measured", colour: () => kindColour(0), x: a.time, low: a[channel.key].min, high: a[channel.key].max },
        { name: "model", colour: () => kindColour(1), dashed: true, x: b.time, low: b[channel.key].min, high: b[channel.key].max }]);
      // The simulation has the recording's own times: rows go together.
      const below = new Chart(plots, { title: `${channel.title}: measured less model`, x: timeAxis, y: channel, group, height: 120, about: () => recording });
      below.set([{ colour: () => colour("--line"), x: a.time, y: a[channel.key].first.map((v, i) => (v === null || b[channel.key].first[i] === null ? null : v - b[channel.key].first[i])) }]);
      this.charts.push(over, below);
      const rms = difference.columns.find((c) => c.dataset.split("/").includes(channel.key))?.rms * channel.factor;
      const range = (Math.max(...a[channel.key].max) - Math.min(...a[channel.key].min.filter((v) => v !== null))) * channel.factor;
      rows.push({ channel: `${channel.name} [${channel.unit}]`, rms, range, share: (rms / range) * 100 });
    }
    place.append(reportTable({ title: "What is left", columns: [column("channel", "channel"), column("rms", "rms of the residual"), column("range", "range"), column("share", "share of the range", "%")], rows, notes: ["Of all samples."] }));
  }

  #chosen(id) {
    return [...byId(id).selectedOptions].map((o) => o.value);
  }

  #fit() {
    const name = byId("fit-name").value.trim() || undefined;
    const free = byId("fit-free").value.split(",").map((path) => path.trim()).filter(Boolean);
    return this.#run("fit-form", "The model was not fitted.",
      () => this.rpc.call("model.fit", { recordings: this.#chosen("fit-recordings"), model: byId("fit-model").value, name, free, starts: 1, report: true }),
      async (result) => {
        byId("fit-result").replaceChildren(...this.#fitted(result, name));
        await this.refresh();
      });
  }

  #fitted(result, name) {
    const rows = (result.parameters ?? []).map((p) => ({ ...p, interval: p.interval ? interval(p.interval) : "–", remark: p.at_bound ? "at its bound" : p.determined === false ? "not determined" : "" }));
    const left = Object.entries(result.after ?? {}).map(([what, after]) => ({ what, before: result.before[what], after }));
    return [
      element("p", {}, result.stopped ? "Stopped: the best so far." : "Fitted.", name ? ` Kept as ${name}.` : ""),
      result.verdict ? element("p", {}, element("strong", {}, result.verdict.text)) : "",
      rows.length ? reportTable({ title: "Parameters", rows, columns: [column("path", "parameter"), column("from", "from"), column("to", "to"), column("interval", "interval"), column("remark", "remark")], notes: [`Sum of squares ${number(result.cost_before)} before, ${number(result.cost_after)} after, ${result.simulations} simulations.`] }) : "",
      left.length ? reportTable({ title: "Root mean square of what is left", rows: left, columns: [column("what", "on"), column("before", "before"), column("after", "after")] }) : "",
      result.html ? button("Report (HTML)", () => download(new Blob([result.html], { type: "text/html" }), `${name ?? "fitted"}.html`)) : "", " ",
      button("Save the model as JSON", () => download(new Blob([JSON.stringify(result.model, null, 2)], { type: "application/json" }), `${name ?? "fitted"}.json`)),
    ];
  }

  #discover() {
    const name = byId("discover-name").value.trim() || undefined;
    const floor = Number(byId("discover-floor").value.replace(",", "."));
    let job;
    return this.#run("discover-form", "The search did not come to an end.",
      async () => (job = await this.rpc.call("discrepancy.start", { recordings: this.#chosen("discover-recordings"), model: byId("discover-model").value, name, floor: floor > 0 ? floor / 100 : undefined })),
      async () => {
        const [found, { effects }] = await Promise.all([this.rpc.call("discrepancy.result", { job: job.job }), this.rpc.call("model.effects")]);
        byId("discover-result").replaceChildren(...this.#found(found, new Map(effects.map((e) => [e.id, e])), job.job, name));
        await this.refresh();
      });
  }

  #found(d, effects, job, name) {
    const gaps = ["train", "held_out"].flatMap((where) => Object.keys(d.gap[where].before)
      .map((channel) => ({ where: `${where === "train" ? "seen" : "locked away"}: ${d.gap[where].recordings.join(", ")}`, channel, before: d.gap[where].before[channel], after: d.gap[where].after[channel] })));
    const parameters = d.added.flatMap((a) => Object.entries(a.parameters ?? {}).map(([key, value]) => ({
      term: `${String(a.id).replaceAll("_", " ")}${a.empirical ? " (empirical)" : ""}`, equation: effects.get(a.id)?.equation ?? "–",
      parameter: key.replaceAll("_", " "), value, unit: effects.get(a.id)?.parameters.find((p) => p.name === key)?.unit ?? "–",
      interval: a.intervals?.[key] ? interval(a.intervals[key]) : "–", share: percent(a.share) + (a.share_of ? ` of the ${a.share_of}` : ""), proof: percent(a.share_held_out) })));
    const verdict = element("dl", { class: "facts" });
    facts(verdict, [["Verdict", String(d.verdict).replaceAll("_", " ")], ["Explained", `${percent(d.share)}, locked away ${percent(d.share_held_out)}`],
      ["Unknown", percent(d.probability_unknown)], ["Nothing missing", percent(d.probability_nothing)]]);
    const next = d.next_experiment;
    const out = [
      element("h4", {}, "Verdict"), verdict,
      element("ul", { class: "findings" }, ...d.findings.map((f) => element("li", {}, f))),
      parameters.length ? reportTable({ title: "What was added", rows: parameters, columns: [column("term", "term"), column("equation", "equation"), column("parameter", "parameter"), column("value", "value"), column("unit", "unit"), column("interval", "90 %"), column("share", "share"), column("proof", "share, locked away")] }) : "",
      gaps.length ? reportTable({ title: "Residual over noise, before and after", rows: gaps, columns: [column("where", "on"), column("channel", "channel"), column("before", "before"), column("after", "after")] }) : "",
      d.explanations.length ? reportTable({ title: "Alternatives", columns: [column("effects", "explanation"), column("probability", "probability", "%")], rows: d.explanations.map((e) => ({ effects: names(e.effects), probability: e.probability * 100 })) }) : "",
    ];
    const actions = element("div", { class: "actions" },
      button("Report (HTML)", async () => download(new Blob([await this.rpc.call("discrepancy.result", { job, format: "html" })], { type: "text/html" }), "missing.html")),
      button("Improved model (JSON)", () => download(new Blob([JSON.stringify(d.model, null, 2)], { type: "application/json" }), `${name ?? "improved"}.json`)));
    const keep = element("input", { "aria-label": "Name to keep the improved model under", placeholder: "name" });
    actions.append(keep, button("Keep the improved model", async () => {
      try {
        clearErrors();
        await this.rpc.call("model.put", { name: keep.value.trim(), model: d.model });
        await this.refresh();
      } catch (error) {
        showError("The model was not kept.", error);
      }
    }));
    if (next) {
      const plenty = 1e6; // as in the report: beyond it the number says nothing
      const odds = `${next.expected_odds > plenty ? "more than " : ""}${number(Math.min(plenty, next.expected_odds), 2)}`;
      out.push(element("p", { class: "next" }, `The experiment that would tell the explanations apart (expected odds ${odds} to 1): `,
        typeof next.protocol === "string" ? next.protocol : next.protocol.title ?? next.protocol.name));
      actions.append(button("Load the next experiment", () => this.load(next.protocol)));
    }
    out.push(actions);
    return out;
  }
}
