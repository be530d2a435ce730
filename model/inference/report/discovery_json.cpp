#include <algorithm>

#include "model/inference/report/discovery_report.h"
#include "recordings/format/version.h"

namespace ferrobench::model {
namespace {

using nlohmann::json;

json or_null(const std::optional<double>& value) {
  return value ? json(*value) : json(nullptr);
}

json by_channel(const ChannelFigures& figures) {
  json out = json::object();
  for (const auto& [channel, value] : figures) out[std::string(recordings::channel_name(channel))] = value;
  return out;
}

json gap(const Gap& g) {
  return {{"recordings", g.recordings}, {"before", by_channel(g.before)}, {"after", by_channel(g.after)}};
}

json estimate(const EffectEstimate& effect) {
  json parameters = json::object(), intervals = json::object();
  for (const auto& p : effect.parameters) {
    parameters[p.name] = p.value;
    intervals[p.name] = {p.low, p.high};
  }
  return {{"id", effect.id}, {"parameters", parameters}, {"intervals", intervals}};
}

json explanation(const Explanation& e) {
  json effects = json::array();
  for (const auto& effect : e.effects) effects.push_back(estimate(effect));
  json out{{"effects", effects}, {"probability", e.probability}};
  if (e.leave_one_out)
    out["left_out"] = {{"recordings", e.leave_one_out->recordings},
                       {"better", e.leave_one_out->better},
                       {"gain", e.leave_one_out->gain}};
  return out;
}

}  // namespace

nlohmann::json to_json(const Discovery& d) {
  json out;
  for (const auto& [verdict, name] : enum_names(Verdict{}))
    if (verdict == d.verdict) out["verdict"] = name;
  out["explanations"] = json::array();
  for (const auto& e : d.explanations) out["explanations"].push_back(explanation(e));
  if (!d.doubted.empty())
    out["doubted"] = explanation({.effects = d.doubted, .probability = 0, .leave_one_out = {}});
  out["probability_unknown"] = d.probability_unknown;
  out["probability_nothing"] = d.probability_nothing;
  out["family"] = d.family ? json(family_name(*d.family)) : json(nullptr);
  out["where"] = json::array();
  for (const auto& w : d.where)
    out["where"].push_back({{"recording", w.recording},
                            {"channel", recordings::channel_name(w.channel)},
                            {"segment", w.segment},
                            {"excess", w.excess}});
  out["recalibrated"] = json::object();
  for (const auto& [path, r] : d.recalibrated)
    out["recalibrated"][path] = {
        {"from", r.from}, {"to", r.to}, {"std", r.std}, {"over_prior", r.over_prior}};
  out["gap"] = {{"train", gap(d.train)}, {"held_out", gap(d.held_out)}};
  out["left"] = json::object();
  for (const auto& [channel, l] : d.left)
    out["left"][std::string(recordings::channel_name(channel))] = {
        {"over_noise", l.over_noise}, {"of_range", l.of_range}, {"model_error", l.model_error}};
  out["share"] = d.share;
  out["share_held_out"] = d.share_held_out;
  out["remainder"] = nullptr;
  if (d.remainder)
    out["remainder"] = {{"family", family_name(d.remainder->family)},
                        {"channel", recordings::channel_name(d.remainder->channel)},
                        {"segment", d.remainder->segment},
                        {"of_range", d.remainder->of_range}};
  out["added"] = json::array();
  for (const auto& a : d.added) {
    out["added"].push_back(estimate(a.term));
    out["added"].back().update({{"empirical", a.empirical},
                                {"share", or_null(a.share)},
                                {"share_of", a.channel ? json(recordings::channel_name(*a.channel)) : json()},
                                {"share_held_out", or_null(a.share_held_out)}});
  }
  out["pasts"] = json::array();
  for (const auto& p : d.pasts) {
    out["pasts"].push_back(protocols::to_json(p.past));
    out["pasts"].back().update({{"recording", p.recording}, {"chosen", p.chosen}});
  }
  out["equivalent"] = d.equivalent;
  out["not_testable"] = d.not_testable;
  out["smallest_detectable"] = d.smallest_detectable;
  out["next_experiment"] = d.next_experiment ? json{{"protocol", d.next_experiment->protocol},
                                                    {"expected_odds", d.next_experiment->expected_odds}}
                                             : json(nullptr);
  if (!d.signals.empty()) out["signals"] = json::array();
  for (const auto& signal : d.signals)
    out["signals"].push_back({{"recording", signal.recording},
                              {"channel", recordings::channel_name(signal.channel)},
                              {"time_s", signal.time},
                              {"value", signal.value}});
  if (!d.cells.empty()) out["cells"] = json::array();
  for (const auto& c : d.cells) {
    json cell{{"table", c.table},
              {"quantity", c.published.quantity},
              {"published", c.published.published},
              {"before", c.before},
              {"after", c.after},
              {"held_out", c.held_out}};
    for (const auto& [name, value] : c.published.keys) cell[name] = value;
    out["cells"].push_back(std::move(cell));
  }
  out["model"] = to_json(d.improved);
  out["findings"] = findings(d);
  const auto& h = d.health;
  json noise = json::object();
  for (const auto& [channel, n] : h.noise)
    noise[std::string(recordings::channel_name(channel))] = {
        {"std", n.std}, {"correlated", n.correlated}, {"correlation_time_s", n.correlation_time}};
  json sources = json::array();
  for (const auto& s : d.asked.sources)
    sources.push_back(
        {{"name", s.name}, {"title", s.title}, {"identifier", s.identifier}, {"start_time", s.start_time}});
  out["asked"] = {{"time", d.asked.time},
                  {"software", recordings::software_version()},
                  {"commit", recordings::software_commit()},
                  {"model", to_json(d.asked.model)},
                  {"sources", sources},
                  {"held_out", d.asked.held_out},
                  {"candidates", d.asked.candidates},
                  {"floor", d.asked.floor},
                  {"seed", d.asked.seed}};
  out["health"] = {{"seconds", h.seconds},
                   {"simulations", h.simulations},
                   {"numerical_error_over_noise", h.numerical_error_over_noise},
                   {"noise", noise},
                   {"starts", h.starts},
                   {"start_spread", h.start_spread},
                   {"largest_left", h.largest_left},
                   {"allowed_left", h.allowed_left},
                   {"warnings", h.warnings}};
  return out;
}

}  // namespace ferrobench::model
