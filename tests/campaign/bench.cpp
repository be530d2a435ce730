#include "tests/campaign/bench.h"

#include <algorithm>
#include <iterator>

#include "model/effects/catalogue.h"
#include "tests/campaign/base_models.h"
#include "tests/campaign/outsiders.h"
#include "tests/campaign/sizing.h"

namespace ferrobench::campaign {

using recordings::Channel;

namespace {

constexpr std::array<std::pair<Kind, std::string_view>, 7> kinds{{{Kind::single, "single"},
                                                                  {Kind::pair, "pair"},
                                                                  {Kind::nothing, "nothing"},
                                                                  {Kind::moved, "moved"},
                                                                  {Kind::outside, "outside"},
                                                                  {Kind::withheld, "withheld"},
                                                                  {Kind::coloured, "coloured"}}};
constexpr std::array<Channel, 4> measured{Channel::field, Channel::charge, Channel::displacement,
                                          Channel::force};

// Where the recordings of a bench can tell what the time constants and the like are.
double draw_shape(Draw& draw, std::string_view id, const model::EffectParameter& p) {
  static const std::map<std::string, std::pair<double, double>, std::less<>> ranges{
      {"self_heating", {2, 20}},        {"viscoelastic_creep", {0.1, 8}}, {"prestress_relaxation", {1, 20}},
      {"guide_friction", {1e-7, 1e-6}}, {"stage_inertia", {0.02, 0.3}},   {"load_cell_creep", {0.5, 15}},
      {"mains_pickup", {45, 150}}};
  const auto found = ranges.find(id);
  return found == ranges.end() ? draw.decades(p.low, p.high)
                               : draw.decades(found->second.first, found->second.second);
}

struct Choice {
  std::string id;
  model::Family family = model::Family::kinetics;
  std::vector<model::EffectParameter> parameters;
};

// Those with a name: an empirical table is no cause that a bench could hide.
const std::vector<model::Effect>& named_effects() {
  static const auto named = [] {
    std::vector<model::Effect> out;
    std::ranges::copy_if(model::effect_catalogue(), std::back_inserter(out),
                         [](const auto& e) { return !e.empirical; });
    return out;
  }();
  return named;
}

Choice catalogue_choice(std::size_t i) {
  const auto& e = named_effects()[i % named_effects().size()];
  return {std::string(e.id), e.family, e.parameters};
}
Choice outsider_choice(std::size_t i) {
  const auto& e = outsiders()[i % outsiders().size()];
  return {std::string(e.id), e.family, e.parameters};
}

// Both act on the same thing in a way that the twin solves for one of them only.
bool clash(const std::string& a, const std::string& b) {
  const auto is = [](const std::string& id, std::string_view x, std::string_view y) {
    return id == x || id == y;
  };
  return a == b ||
         (is(a, "domain_wall_drag", "source_resistance") && is(b, "domain_wall_drag", "source_resistance")) ||
         (is(a, "amplifier_lag", "amplifier_slew_limit") && is(b, "amplifier_lag", "amplifier_slew_limit"));
}

std::vector<Choice> choose(const Bench& bench, Draw& draw) {
  const std::size_t turn = static_cast<std::size_t>(bench.index) * 7 + bench.seed * 13;
  switch (bench.kind) {
    case Kind::nothing:
    case Kind::moved:
      return {};
    case Kind::single:
    case Kind::withheld:
      return {catalogue_choice(turn)};
    case Kind::outside:
      return {outsider_choice(turn)};
    case Kind::coloured:
      if (bench.index % 2 == 0) return {};
      return {catalogue_choice(draw.below(1000))};
    case Kind::pair:
      for (;;) {
        auto a = catalogue_choice(turn), b = catalogue_choice(draw.below(1000));
        if (!clash(a.id, b.id)) return {a, b};
      }
  }
  return {};
}

// Where the effect is a base parameter that the model has at zero.
void make_absent(model::Model& m, const std::string& id) {
  if (id == "barrier_distribution") m.polycrystal.barrier_log_std = 0;
  if (id == "interaction_field_distribution") m.polycrystal.interaction_field_std = 0;
  if (id == "internal_bias_field") m.polycrystal.bias_field = 0;
  if (id == "passive_layer_compliance") m.actuator.passive_stiffness.reset();
}

// White, or half of its variance with a memory of some samples.
std::vector<double> noise(Draw& draw, std::size_t n, double std, double memory) {
  std::vector<double> out(n);
  double slow = draw.normal();
  for (double& v : out) {
    if (memory > 0) slow = memory * slow + std::sqrt(1 - memory * memory) * draw.normal();
    v = memory > 0 ? std * std::sqrt(0.5) * (slow + draw.normal()) : std * draw.normal();
  }
  return out;
}

const std::vector<double>& column(const Response& r, Channel c) {
  if (c == Channel::charge) return r.charge;
  if (c == Channel::displacement) return r.displacement;
  return c == Channel::force ? r.force : r.field;
}

}  // namespace

std::span<const std::pair<Kind, std::string_view>> enum_names(Kind) {
  return kinds;
}

std::string_view kind_name(Kind kind) {
  return std::ranges::find(kinds, kind, [](const auto& k) { return k.first; })->second;
}

Kind kind_named(std::string_view name) {
  std::string all;
  for (const auto& [kind, text] : kinds) {
    if (text == name) return kind;
    all += (all.empty() ? "" : ", ") + std::string(text);
  }
  throw Error(ErrorCode::invalid_params,
              "there is no kind \"" + std::string(name) + "\" of bench, only " + all);
}

Kind kind_of(int index) {
  using enum Kind;
  static constexpr std::array<Kind, 25> cycle{
      single,   nothing, pair,    outside, single,   moved,  single, coloured, single,
      withheld, single,  nothing, pair,    single,   moved,  single, outside,  single,
      coloured, single,  nothing, pair,    withheld, single, moved};
  return cycle.at(static_cast<std::size_t>(index) % cycle.size());
}

Bench make_bench(std::uint64_t seed, int index, Kind kind, const BenchOptions& options) {
  Draw draw(seed * 1000003 + static_cast<std::uint64_t>(index));
  Bench b;
  b.seed = seed;
  b.index = index;
  b.kind = kind;
  b.coloured = kind == Kind::coloured;
  const auto choices = choose(b, draw);
  b.handed = draw_base(draw);
  for (const auto& choice : choices) make_absent(b.handed, choice.id);
  b.base = move_parameters(b.handed, draw, kind == Kind::moved ? 1 + static_cast<int>(draw.below(4)) : 0);
  const auto programs = draw_programs(draw.generator, draw.between(1.8e6, 2.2e6));

  const Sizing sizing(b.base, programs);
  std::array<double, 4> std = sizing.ranges();
  for (double& v : std) v *= draw.decades(1e-3, 5e-3);
  for (const auto& choice : choices) {
    model::EffectSetting effect{.id = choice.id, .parameters = {}};
    double reached = 0;
    for (int attempt = 0; attempt < 3 && !(reached > 1.2 && reached < 60); ++attempt) {
      effect.parameters.clear();
      for (const auto& p : choice.parameters)
        effect.parameters.emplace_back(p.name,
                                       draw_shape(draw, choice.id, p) * (p.any_sign ? draw.sign() : 1));
      effect = sizing.sized(effect, choice.parameters.front(), draw.decades(1.5, 40), std, &reached);
    }
    b.effects.push_back(effect);
    b.sizes.push_back(reached);
    b.families.emplace_back(model::family_name(choice.family));
  }
  if (kind == Kind::withheld)
    for (const auto& e : named_effects())
      if (e.id != choices[0].id) b.candidates.emplace_back(e.id);

  const bool drive = std::any_of(choices.begin(), choices.end(),
                                 [](const Choice& c) { return c.family == model::Family::drive; });
  const bool command = drive || draw.chance(options.commanded);
  const bool from_first = draw.chance(0.2);
  const auto ranges = sizing.ranges();
  for (std::size_t c = 0; c < measured.size(); ++c) {
    b.noise[measured.at(c)] = std.at(c);
    b.gain[measured.at(c)] = 1 + draw.sign() * draw.between(0.01, 0.02);
    b.offset[measured.at(c)] = draw.sign() * draw.between(0.01, 0.02) * ranges.at(c);
  }
  double session = 0;
  for (const auto& p : programs) {
    const auto truth = play(loaded(b.base, p), b.effects, p.time, p.command,
                            {.domains = options.domains, .path = 1, .session_time = session});
    session += p.time.back();
    recordings::Recording r;
    r.header.title = p.name;
    const auto stated = loaded(b.handed, p);
    r.header.specimen = {.name = "",
                         .length = stated.actuator.length,
                         .area = stated.actuator.area,
                         .layer_thickness = stated.actuator.layer_thickness,
                         .layer_count = stated.actuator.layer_count};
    r.header.load = {.spring_stiffness = stated.load.spring_stiffness, .prestress = stated.load.prestress};
    r.header.charge_reference =
        from_first ? recordings::ChargeReference::first_sample : recordings::ChargeReference::absolute;
    r.time = p.time;
    if (command) r.set(Channel::command) = p.command;
    for (const auto c : measured) {
      auto& out = r.set(c);
      const auto& clean = column(truth, c);
      out = noise(draw, p.time.size(), b.noise[c], b.coloured ? draw.between(0.7, 0.95) : 0);
      const double zero = c == Channel::charge && from_first ? clean[0] : 0;
      const double offset = c == Channel::charge && from_first ? 0 : b.offset[c];
      for (std::size_t i = 0; i < out.size(); ++i) out[i] += b.gain[c] * (clean[i] - zero) + offset;
    }
    b.recordings.push_back({p.name, std::move(r)});
  }
  return b;
}

}  // namespace ferrobench::campaign
