#include "model/inference/report/discovery_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/number_text.h"
#include "model/inference/report/discovery_pictures.h"
#include "model/inference/report/moved_parameters.h"
#include "recordings/format/version.h"
#include "recordings/reports/html_page.h"
#include "recordings/reports/table.h"

namespace ferrobench::model {
namespace {

using recordings::escape_html;

std::string readable(std::string_view id) {
  std::string out(id);
  std::ranges::replace(out, '_', ' ');
  return out;
}

std::string names_of(const Explanation& e) {
  std::string out;
  for (const auto& effect : e.effects) out += (out.empty() ? "" : " and ") + readable(effect.id);
  return out;
}

std::string percent(double probability) {
  return probability > 0.99 ? "more than 99 %" : fmt::format("{:.0f} %", 100 * probability);
}

std::string parameter_text(const Effect& effect, const EffectEstimate::Parameter& p) {
  const auto [low, high] = interval_text(p.low, p.high);
  for (const auto& known : effect.parameters)
    if (known.name == p.name)
      return fmt::format("{} = {:.4g} {} (90 %: {} to {}; plausible: {}{:.3g} to {:.3g})", readable(p.name),
                         p.value, known.unit == "1" ? "" : std::string(known.unit), low, high,
                         known.any_sign ? "either sign, " : "", known.low, known.high);
  return p.name;
}

std::string doubt_sentence(const std::vector<EffectEstimate>& doubted) {
  std::string out = "Something is missing, but what it is cannot be told.";
  for (const auto& e : doubted) {
    const bool first = e.id == doubted.front().id;
    out += first ? fmt::format(" {} would explain it", readable(e.id))
                 : fmt::format(" It would together with {}", readable(e.id));
    for (const auto& p : e.parameters) out += ", " + parameter_text(find_effect(e.id), p);
    out += ".";
  }
  return out +
         " That is not plausible, could as well be nothing, or is refuted by the recordings that were locked "
         "away, so it is not named.";
}

std::string verdict_sentence(const Discovery& d) {
  switch (d.verdict) {
    case Verdict::named:
      return fmt::format("Missing in the model: {}. Probability {}.", names_of(d.explanations.front()),
                         percent(d.explanations.front().probability));
    case Verdict::ambiguous: {
      std::string out = "Something is missing, and these recordings cannot tell which of these it is: ";
      for (std::size_t i = 0; i < d.explanations.size(); ++i)
        if (i == 0 || d.explanations[i].probability > 0.05)
          out += fmt::format("{}{} ({})", i > 0 ? ", or " : "", names_of(d.explanations[i]),
                             percent(d.explanations[i].probability));
      return out + ".";
    }
    case Verdict::unknown: {
      if (!d.doubted.empty()) return doubt_sentence(d.doubted);
      auto out =
          fmt::format("Something is missing, but nothing in the catalogue explains it. It acts on: {}.",
                      d.family ? family_name(*d.family) : "no single place");
      if (!d.explanations.empty() && !d.where.empty())
        out += fmt::format(" The nearest was {}; it is not enough.", names_of(d.explanations.front()));
      return out;
    }
    case Verdict::nothing_missing:
      break;
  }
  return fmt::format(
      "Nothing is missing: with its parameters recalibrated the model explains the recordings down to their "
      "noise (probability {}).",
      percent(d.probability_nothing));
}

std::string place_sentence(const Excess& w) {
  return fmt::format("{}, {}, {}: the miss is {:.1f} times the noise.", w.recording,
                     recordings::channel_name(w.channel), w.segment, w.excess);
}

std::string gap_sentence(const std::string& on, const Gap& g) {
  std::string out = on + ", residual over noise before and after: ";
  bool first = true;
  for (const auto& [channel, before] : g.before) {
    const auto after = g.after.find(channel);
    out += fmt::format("{}{} {:.2f} to {:.2f}", first ? "" : ", ", recordings::channel_name(channel), before,
                       after == g.after.end() ? NAN : after->second);
    first = false;
  }
  return out + ".";
}

std::string list(const std::vector<std::string>& items) {
  std::string out;
  for (const auto& i : items) out += (out.empty() ? "" : ", ") + i;
  return out;
}

struct Section {
  std::string title;
  std::vector<std::string> lines;
};

std::vector<std::string> added_lines(const Discovery& d) {
  std::vector<std::string> out;
  if (d.verdict == Verdict::unknown && !d.added.empty())
    out.emplace_back(
        "Terms that narrow the gap and hold on recordings that were locked away. They do not say why it is "
        "there.");
  for (const auto& a : d.added) {
    const auto& effect = find_effect(a.term.id);
    out.push_back(fmt::format("{} ({}{}): {}", readable(a.term.id), a.empirical ? "empirical, " : "",
                              family_name(effect.family), effect.equation));
    if (a.share)
      out.push_back(fmt::format(
          "It takes {:.0f} % of the excess{} that stood before it{}.", 100 * *a.share,
          a.channel ? fmt::format(" of the {}", recordings::channel_name(*a.channel)) : "",
          a.share_held_out ? fmt::format(", {:.0f} % on locked recordings", 100 * *a.share_held_out) : ""));
    if (effect.table) continue;  // many weights: the model file has them
    for (const auto& p : a.term.parameters) out.push_back(parameter_text(effect, p));
  }
  return out;
}

std::vector<std::string> left_lines(const Discovery& d) {
  std::vector<std::string> out;
  for (const auto& [channel, l] : d.left)
    out.push_back(
        fmt::format("{}: {:.2f} % of the range, {:.1f} times the noise; the model's own error is {:.2f} %.",
                    recordings::channel_name(channel), 100 * l.of_range, l.over_noise, 100 * l.model_error));
  if (!d.added.empty())
    out.push_back(fmt::format("What was added takes {:.0f} % of the excess over noise{}.", 100 * d.share,
                              d.held_out.recordings.empty()
                                  ? ""
                                  : fmt::format(", {:.0f} % on locked recordings", 100 * d.share_held_out)));
  if (d.remainder)
    out.push_back(
        fmt::format("Something remains: {:.2f} % of the range of the {}, most of it in {}; it acts on: {}.",
                    100 * d.remainder->of_range, recordings::channel_name(d.remainder->channel),
                    d.remainder->segment, family_name(d.remainder->family)));
  return out;
}

std::vector<std::string> past_lines(const Discovery& d) {
  std::vector<std::string> out;
  for (const auto& p : d.pasts)
    if (p.chosen && p.past.kind != protocols::PastKind::poled_plus)
      out.push_back(fmt::format("Before {} it was likeliest {}.", p.recording, protocols::in_words(p.past)));
  if (std::ranges::any_of(d.pasts, [](const auto& p) { return p.chosen && p.past.levels.size() > 1; }))
    out.emplace_back(
        "The levels are those of the earlier tables of the file, and of a cycle of each table's own program "
        "before it where the specimen had one.");
  return out;
}

std::vector<Section> sections(const Discovery& d) {
  std::vector<Section> out;
  out.push_back({"Verdict", {verdict_sentence(d)}});
  if (d.verdict != Verdict::nothing_missing) {
    Section s{"Where the model misses", {}};
    for (std::size_t i = 0; i < std::min<std::size_t>(5, d.where.size()); ++i)
      s.lines.push_back(place_sentence(d.where[i]));
    for (const auto& signal : d.signals) {
      const auto [low, high] = std::ranges::minmax(signal.value);
      s.lines.push_back(fmt::format("It acts like an addition to the {} that ranges over {:.3g} {} in {}.",
                                    recordings::channel_name(signal.channel), high - low,
                                    recordings::channel_unit(signal.channel), signal.recording));
    }
    out.push_back(s);
  }
  if (auto lines = added_lines(d); !lines.empty()) out.push_back({"What was added", std::move(lines)});
  out.push_back({"What is left", left_lines(d)});
  if (auto lines = past_lines(d); !lines.empty())
    out.push_back({"What the specimen had been through", std::move(lines)});
  Section proof{"Proof", {}};
  if (!d.held_out.recordings.empty())
    proof.lines.push_back(gap_sentence(
        "On recordings that were locked away (" + list(d.held_out.recordings) + ")", d.held_out));
  else
    proof.lines.emplace_back(
        "There were too few recordings to lock one away: there is no proof on unseen data.");
  proof.lines.push_back(gap_sentence("On the others", d.train));
  if (d.verdict != Verdict::nothing_missing && !d.explanations.empty() &&
      d.explanations.front().leave_one_out) {
    const auto& l = *d.explanations.front().leave_one_out;
    proof.lines.push_back(fmt::format(
        "Each of the others predicted from the rest: with {} {} of {} come out better than without, "
        "and the sum of squared residuals {} by {:.3g}.",
        names_of(d.explanations.front()), l.better, l.recordings, l.gain < 0 ? "rises" : "falls",
        std::abs(l.gain)));
  }
  out.push_back(proof);
  Section rivals{"Alternatives", {}};
  for (std::size_t i = 1; i < d.explanations.size() && i < 4; ++i)
    if (d.explanations[i].probability > 0.005)
      rivals.lines.push_back(
          fmt::format("{}: {}", names_of(d.explanations[i]), percent(d.explanations[i].probability)));
  if (d.verdict != Verdict::nothing_missing)
    rivals.lines.push_back(
        fmt::format("Something outside the catalogue: {}", percent(d.probability_unknown)));
  for (const auto& group : d.equivalent) {
    std::vector<std::string> names;
    names.reserve(group.size());
    for (const auto& id : group) names.push_back(readable(id));
    rivals.lines.push_back("Not to be told apart with these recordings: " + list(names) + ".");
  }
  // Beyond a million the linear prediction and the noise's model decide, and the number says nothing.
  constexpr double plenty = 1e6;
  if (const auto& next = d.next_experiment)
    rivals.lines.push_back(fmt::format("To decide, run the protocol {}: expected odds {}{:.3g} : 1.",
                                       next->protocol, next->expected_odds > plenty ? "of more than " : "",
                                       std::min(plenty, next->expected_odds)));
  if (!rivals.lines.empty()) out.push_back(rivals);
  if (auto lines = astonishing_moves(d); !lines.empty())
    out.push_back({"What moved beyond what was known of it", std::move(lines)});
  Section changed{"What changed only as a parameter", moved_parameters(d)};
  if (changed.lines.empty()) changed.lines.emplace_back("No parameter moved by more than its uncertainty.");
  out.push_back(changed);
  Section limits{"What these recordings could not show", {}};
  if (!d.not_testable.empty()) {
    std::vector<std::string> names;
    for (const auto& id : d.not_testable) names.push_back(readable(id));
    limits.lines.push_back("Not testable: " + list(names) + ".");
  }
  if (d.smallest_detectable.empty())  // a model that is wrong by much hides more than noise does
    limits.lines.emplace_back("Of no effect is it known how small it would have shown.");
  else if (limits.lines.empty())
    limits.lines.emplace_back("Every effect of the catalogue would have shown at a plausible size.");
  out.push_back(limits);
  return out;
}

recordings::Table pairs_table(const std::string& key, const std::string& title) {
  recordings::Table out;
  out.key = key;
  out.title = title;
  out.columns = {{"what", "", ""}, {"value", "", ""}};
  return out;
}

recordings::Table health_table(const Discovery& d) {
  auto out = pairs_table("health", "Health");
  const auto row = [&out](const std::string& what, const std::string& value) {
    out.rows.push_back({what, value});
  };
  const bool timed = d.health.seconds > 0;
  row("simulations",
      fmt::format("{}{}", d.health.simulations, timed ? fmt::format(" in {:.0f} s", d.health.seconds) : ""));
  row("their own numerical error", fmt::format("{:.2f} of the noise", d.health.numerical_error_over_noise));
  row("starts of the recalibration", fmt::format("{}", d.health.starts));
  if (d.health.allowed_left > 0)
    row("left after the explanation",
        fmt::format("{:.0f} of {:.0f} allowed (drop of the sum of squares by anything more)",
                    std::max(0.0, d.health.largest_left), d.health.allowed_left));
  for (const auto& [channel, n] : d.health.noise)
    row(fmt::format("noise of the {}", recordings::channel_name(channel)),
        fmt::format("{:.3g} {}{}", n.std, recordings::channel_unit(channel),
                    n.correlated ? fmt::format(", correlated over {:.2g} s", n.correlation_time) : ""));
  out.notes = d.health.warnings;
  return out;
}

recordings::Table asked_table(const Discovery& d) {
  const auto& a = d.asked;
  auto out = pairs_table("asked", "What was asked");
  const auto row = [&out](const std::string& what, const std::string& value) {
    out.rows.push_back({what, value});
  };
  row("model", a.model.name);
  for (const auto& s : a.sources)
    row(&s == a.sources.data() ? "recordings" : "", s.name + (s.title.empty() ? "" : ": " + s.title) +
                                                        (s.start_time.empty() ? "" : ", " + s.start_time) +
                                                        (s.identifier.empty() ? "" : ", " + s.identifier));
  row("locked away", a.held_out.empty() ? "chosen: " + list(d.held_out.recordings) : list(a.held_out));
  row("candidates", a.candidates.empty() ? "the whole catalogue" : list(a.candidates));
  row("floor", fmt::format("{:g} % of a channel's range", 100 * a.floor));
  row("seed", fmt::format("{}", a.seed));
  if (!a.time.empty()) row("date", a.time);
  row("ferrobench",
      fmt::format("{}, commit {}", recordings::software_version(), recordings::software_commit()));
  return out;
}

recordings::Table detectable_table(const Discovery& d) {
  recordings::Table out{.key = "detectable",
                        .title = "Smallest size that would have been seen",
                        .columns = {{"effect", "effect", ""},
                                    {"parameter", "parameter", ""},
                                    {"size", "size", ""},
                                    {"unit", "unit", ""}},
                        .rows = {},
                        .notes = {}};
  for (const auto& [id, parameters] : d.smallest_detectable)
    for (const auto& [name, value] : parameters) {
      std::string_view unit;
      for (const auto& p : find_effect(id).parameters)
        if (p.name == name) unit = p.unit;
      out.rows.push_back({readable(id), readable(name), fmt::format("{:.2g}", value), std::string(unit)});
    }
  return out;
}

// Published cells; none if recordings were the bench.
std::vector<recordings::Table> cell_tables(const Discovery& d) {
  std::vector<recordings::Table> out;
  for (const auto& c : d.cells) {
    const std::string key = "table_" + c.table + "_" + c.published.quantity;
    if (out.empty() || out.back().key != key) {
      auto& t = out.emplace_back();
      t.key = key;
      t.title = "Table " + c.table + ": " + readable(c.published.quantity);
      for (const auto& [name, value] : c.published.keys) t.columns.push_back({name, readable(name), ""});
      t.columns.insert(t.columns.end(), {{"published", "published", ""},
                                         {"before", "model before", ""},
                                         {"after", "model after", ""},
                                         {"held_out", "locked away", ""}});
    }
    auto& row = out.back().rows.emplace_back();
    for (const auto& [name, value] : c.published.keys) row.emplace_back(value);
    row.insert(row.end(), {c.published.published, c.before, c.after, std::string(c.held_out ? "yes" : "")});
  }
  return out;
}

}  // namespace

std::vector<std::string> findings(const Discovery& d) {
  std::vector<std::string> out;
  for (const auto& s : sections(d)) out.insert(out.end(), s.lines.begin(), s.lines.end());
  return out;
}

std::string text_report(const Discovery& d) {
  std::string out;
  for (const auto& s : sections(d)) {
    out += s.title + "\n";
    for (const auto& line : s.lines) out += "  " + line + "\n";
  }
  for (const auto& table : cell_tables(d)) out += "\n" + to_text(table);
  return out + "\n" + to_text(health_table(d)) + "\n" + to_text(asked_table(d));
}

std::string html_report(const Discovery& d) {
  std::string body;
  for (const auto& s : sections(d)) {
    body += "<h2>" + escape_html(s.title) + "</h2>\n";
    if (s.lines.size() == 1) {
      body += "<p>" + escape_html(s.lines.front()) + "</p>\n";
    } else {
      body += "<ul>\n";
      for (const auto& line : s.lines) body += "<li>" + escape_html(line) + "</li>\n";
      body += "</ul>\n";
    }
    if (s.title == "Where the model misses" ||
        (s.title == "Verdict" && d.verdict == Verdict::nothing_missing))
      body += pictures(d);
  }
  for (const auto& table : cell_tables(d)) body += to_html(table);
  if (!d.smallest_detectable.empty()) body += to_html(detectable_table(d));
  return recordings::html_frame("What the model misses",
                                body + to_html(health_table(d)) + to_html(asked_table(d)));
}

}  // namespace ferrobench::model
