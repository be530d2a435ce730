#include "tests/campaign/table.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>

namespace ferrobench::campaign {
namespace {

using Test = std::function<bool(const Outcome&)>;

double median(std::vector<double> v) {
  if (v.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::sort(v.begin(), v.end());
  const std::size_t n = v.size();
  return n % 2 == 1 ? v[n / 2] : 0.5 * (v[n / 2 - 1] + v[n / 2]);
}

Figure share(const std::vector<Outcome>& outcomes, std::string name, double goal, bool at_least,
             const Test& of, const Test& counts) {
  Figure f{.name = std::move(name), .goal = goal, .at_least = at_least};
  double yes = 0;
  for (const auto& o : outcomes)
    if (of(o)) {
      ++f.count;
      yes += counts(o);
    }
  if (f.count > 0) f.value = yes / static_cast<double>(f.count);
  return f;
}

Figure middle(const std::vector<Outcome>& outcomes, std::string name, double goal, bool at_least,
              const std::function<std::vector<double>(const Outcome&)>& values) {
  Figure f{.name = std::move(name), .goal = goal, .at_least = at_least};
  std::vector<double> all;
  for (const auto& o : outcomes)
    if (const auto v = values(o); !v.empty()) {
      ++f.count;
      all.insert(all.end(), v.begin(), v.end());
    }
  f.value = median(all);
  return f;
}

bool physics(const Outcome& o) {
  return o.kind == Kind::physics;
}
bool single(const Outcome& o) {
  return o.in_catalogue && o.truth.size() == 1 && !physics(o);
}
bool pair(const Outcome& o) {
  return o.in_catalogue && o.truth.size() == 2 && !physics(o);
}
bool nothing(const Outcome& o) {
  return o.truth.empty() && o.kind != Kind::moved && !physics(o);
}
Test physics_with(double least, double below) {
  return [=](const Outcome& o) { return physics(o) && o.over_left >= least && o.over_left < below; };
}

std::string line(const std::string& name, const std::vector<Outcome>& outcomes, const Test& of) {
  std::size_t count = 0, right = 0, wrong = 0, unknown = 0, quiet = 0, failed = 0;
  for (const auto& o : outcomes) {
    if (!of(o)) continue;
    ++count;
    right += o.right();
    wrong += o.wrong_name();
    unknown += o.verdict == "unknown";
    quiet += o.verdict == "nothing_missing";
    failed += o.verdict == "error";
  }
  if (count == 0) return "";
  char text[160];
  std::snprintf(text, sizeof text, "| %s | %zu | %zu | %zu | %zu | %zu | %zu |\n", name.c_str(), count, right,
                wrong, unknown, quiet, failed);
  return text;
}

// Calls visit(from, to, bin) for those that hold any.
template <class Visit>
void for_each_bin(const Reliability& r, Visit&& visit) {
  for (std::size_t i = 0; i < r.bins.size(); ++i)
    if (r.bins.at(i).count > 0) visit(Reliability::edges.at(i), Reliability::edges.at(i + 1), r.bins.at(i));
}

}  // namespace

std::vector<Figure> figures(const std::vector<Outcome>& all) {
  const Test right = [](const Outcome& o) { return o.right(); };
  const Test named = [](const Outcome& o) { return o.names(); };
  const Test any = [](const Outcome&) { return true; };
  std::vector<Figure> out;
  out.push_back(share(all, "single effect: right name first", 0.9, true, single, right));
  out.push_back(share(all, "single effect: right up to what cannot be told apart", 0.95, true, single,
                      [](const Outcome& o) { return o.right() || o.class_right; }));
  out.push_back(share(all, "pair: both", 0.65, true, pair, right));
  out.push_back(share(all, "pair: at least one", 0.95, true, pair, [](const Outcome& o) { return o.hit(); }));
  out.push_back(share(all, "nothing missing: an effect named", 0.05, false, nothing, named));
  out.push_back(share(
      all, "moved parameters: an effect named", 0.04, false,
      [](const Outcome& o) { return o.kind == Kind::moved; }, named));
  out.push_back(share(
      all, "outside the catalogue: unknown", 0.85, true, [](const Outcome& o) { return !o.in_catalogue; },
      right));
  out.push_back(share(all, "wrong name at a stated probability over 0.8", 0.03, false, any,
                      [](const Outcome& o) { return o.wrong_name() && o.probability > 0.8; }));
  constexpr double any_more = std::numeric_limits<double>::infinity();
  out.push_back(share(all, "another physics, effect at least 2 times what it leaves: right name first", 0.85,
                      true, physics_with(2, any_more), right));
  out.push_back(share(all, "another physics, effect at least 5 times what it leaves: right name first", 0.95,
                      true, physics_with(5, any_more), right));
  out.push_back(share(
      all, "another physics, nothing on top: an effect named", 0.05, false,
      [](const Outcome& o) { return physics(o) && o.truth.empty(); }, named));
  out.push_back(middle(all, "another physics: share of the locked excess that right names remove, median",
                       0.8, true, [](const Outcome& o) {
                         const bool counts = physics(o) && o.names() && o.right();
                         return counts ? std::vector<double>{o.share_held_out} : std::vector<double>{};
                       }));
  // Of its rms above noise, where the locked recordings show any.
  out.push_back(middle(all, "another physics, unknown: locked gap, after over before, median", 0.5, false,
                       [](const Outcome& o) {
                         const bool counts = physics(o) && o.verdict == "unknown" && o.before > 1.05;
                         return counts ? std::vector<double>{std::sqrt(1 - o.share_held_out)}
                                       : std::vector<double>{};
                       }));
  out.push_back(middle(all, "parameters of right names: median relative error", 0.1, false,
                       [](const Outcome& o) { return o.parameter_errors; }));
  Figure holding{.name = "90 % intervals that hold the hidden value", .goal = 0.8, .at_least = true};
  double intervals = 0, held = 0;
  for (const auto& o : all) {
    holding.count += o.intervals > 0;
    intervals += o.intervals;
    held += o.holding;
  }
  if (intervals > 0) holding.value = held / intervals;
  out.push_back(holding);
  out.push_back(middle(all, "held-out residual over noise after, median, effects of the catalogue", 1.1,
                       false, [](const Outcome& o) {
                         const bool counts = o.in_catalogue && !o.truth.empty() && !physics(o) && o.after > 0;
                         return counts ? std::vector<double>{o.after} : std::vector<double>{};
                       }));
  Figure calibration{
      .name = "stated probabilities: expected calibration error", .goal = 0.07, .at_least = false};
  const auto r = reliability(all);
  for (const auto& bin : r.bins) calibration.count += bin.count;
  if (calibration.count > 0) calibration.value = r.expected_calibration_error;
  out.push_back(calibration);
  out.push_back(middle(all, "seconds a bench, median", 60, false, [](const Outcome& o) {
    return o.seconds > 0 ? std::vector<double>{o.seconds} : std::vector<double>{};
  }));
  return out;
}

Reliability reliability(const std::vector<Outcome>& outcomes) {
  Reliability out;
  double total = 0;
  for (const auto& o : outcomes) {
    if (o.verdict == "error") continue;
    const auto above =
        std::ranges::upper_bound(Reliability::edges, o.probability) - Reliability::edges.begin();
    auto& bin =
        out.bins.at(static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(above, 1, std::ssize(out.bins)) - 1));
    ++bin.count;
    bin.stated += o.probability;
    bin.right += o.right();
    out.brier += std::pow(o.probability - o.right(), 2);
    ++total;
  }
  if (total == 0) return out;
  for (auto& bin : out.bins) {
    if (bin.count == 0) continue;
    out.expected_calibration_error += std::abs(bin.stated - bin.right) / total;
    bin.stated /= static_cast<double>(bin.count);
    bin.right /= static_cast<double>(bin.count);
  }
  out.brier /= total;
  return out;
}

std::string text_of(const std::vector<Outcome>& outcomes) {
  std::string out = "\n| figure | measured | goal | benches | |\n|---|---|---|---|---|\n";
  char text[200];
  for (const auto& f : figures(outcomes)) {
    if (f.count == 0) continue;
    std::snprintf(text, sizeof text, "| %s | %.3g | %s %.3g | %zu | %s |\n", f.name.c_str(), f.value,
                  f.at_least ? "at least" : "at most", f.goal, f.count, f.met() ? "met" : "not met");
    out += text;
  }
  out +=
      "\n| benches | of them | right | wrong name | unknown | nothing missing | error "
      "|\n|---|---|---|---|---|---|---|\n";
  for (const auto& [kind, name] : enum_names(Kind{}))
    out += line(std::string(name), outcomes, [k = kind](const Outcome& o) { return o.kind == k; });
  const std::array<double, 5> edges{0, 3, 8, 20, 1e9};
  for (std::size_t i = 0; i + 1 < edges.size(); ++i) {
    std::snprintf(text, sizeof text, "single, size %g to %g", edges.at(i), edges.at(i + 1));
    out += line(i + 2 < edges.size() ? text : "single, larger", outcomes, [&](const Outcome& o) {
      return single(o) && o.size >= edges.at(i) && o.size < edges.at(i + 1);
    });
  }
  out += line("physics, nothing on top", outcomes,
              [](const Outcome& o) { return physics(o) && o.truth.empty(); });
  out += line("physics, effect 2 to 5 times what it leaves", outcomes, physics_with(2, 5));
  out += line("physics, effect 5 times or more", outcomes, physics_with(5, 1e9));
  const auto r = reliability(outcomes);
  out += "\nVerdicts by stated probability (o: share that was right, |: stated)\n";
  for_each_bin(r, [&](double from, double to, const Reliability::Bin& bin) {
    std::string scale(51, '.');
    scale[static_cast<std::size_t>(std::lround(50 * bin.stated))] = '|';
    scale[static_cast<std::size_t>(std::lround(50 * bin.right))] = 'o';
    std::snprintf(text, sizeof text, "  %-4g to %-4g  %s  %3zu  stated %.3f  right %.3f\n", from, to,
                  scale.c_str(), bin.count, bin.stated, bin.right);
    out += text;
  });
  std::snprintf(text, sizeof text, "  expected calibration error %.3f, Brier score %.3f\n",
                r.expected_calibration_error, r.brier);
  out += text;
  out += "\n| verdict | stated probability | benches | stated | right |\n|---|---|---|---|---|\n";
  for (const auto& [verdict, name] : enum_names(model::Verdict{})) {
    std::vector<Outcome> of;
    std::ranges::copy_if(outcomes, std::back_inserter(of),
                         [n = name](const Outcome& o) { return o.verdict == n; });
    for_each_bin(reliability(of),
                 [&, n = std::string(name)](double from, double to, const Reliability::Bin& bin) {
                   std::snprintf(text, sizeof text, "| %s | %g to %g | %zu | %.3f | %.3f |\n", n.c_str(),
                                 from, to, bin.count, bin.stated, bin.right);
                   out += text;
                 });
  }
  return out;
}

nlohmann::json json_of(const std::vector<Outcome>& outcomes) {
  nlohmann::json out{{"benches", nlohmann::json::array()}, {"figures", nlohmann::json::array()}};
  for (const auto& o : outcomes) out["benches"].push_back(to_json(o));
  for (const auto& f : figures(outcomes))
    out["figures"].push_back({{"name", f.name},
                              {"value", f.count > 0 ? nlohmann::json(f.value) : nlohmann::json()},
                              {"goal", f.goal},
                              {"at_least", f.at_least},
                              {"benches", f.count},
                              {"met", f.count > 0 && f.met()}});
  const auto r = reliability(outcomes);
  for (std::size_t i = 0; i < r.bins.size(); ++i)
    out["reliability"]["bins"].push_back({{"from", Reliability::edges.at(i)},
                                          {"to", Reliability::edges.at(i + 1)},
                                          {"count", r.bins.at(i).count},
                                          {"stated", r.bins.at(i).stated},
                                          {"right", r.bins.at(i).right}});
  out["reliability"]["expected_calibration_error"] = r.expected_calibration_error;
  out["reliability"]["brier"] = r.brier;
  return out;
}

}  // namespace ferrobench::campaign
