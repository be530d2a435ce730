#include "tests/campaign/bench.h"

#include <algorithm>
#include <array>
#include <iterator>

#include "model/effects/catalogue.h"
#include "tests/campaign/base_models.h"
#include "tests/campaign/other_physics.h"
#include "tests/campaign/recalibration.h"

namespace ferrobench::campaign {

using recordings::Channel;

namespace {

constexpr std::array<std::pair<Kind, std::string_view>, 8> kinds{{{Kind::single, "single"},
                                                                  {Kind::pair, "pair"},
                                                                  {Kind::nothing, "nothing"},
                                                                  {Kind::moved, "moved"},
                                                                  {Kind::outside, "outside"},
                                                                  {Kind::withheld, "withheld"},
                                                                  {Kind::coloured, "coloured"},
                                                                  {Kind::physics, "physics"}}};
// In the order of columns().
constexpr std::array<Channel, 4> all_channels{Channel::field, Channel::charge, Channel::displacement,
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

// In the catalogue since seeds were published. They may be named, and the twin has them, but they are not
// drawn: a seed's benches would be others.
constexpr std::array later{"mean_field_interaction"};

// Those with a name: an empirical table is no cause that a bench could hide.
const std::vector<model::Effect>& named_effects() {
  static const auto named = [] {
    std::vector<model::Effect> out;
    std::ranges::copy_if(model::effect_catalogue(), std::back_inserter(out), [](const auto& e) {
      return !e.empirical && std::ranges::find(later, e.id) == later.end();
    });
    return out;
  }();
  return named;
}

Choice catalogue_choice(std::size_t i) {
  const auto& e = named_effects()[i % named_effects().size()];
  return {std::string(e.id), e.family, e.parameters};
}
Choice choice_of(const Outsider& e) {
  return {std::string(e.id), e.family, e.parameters};
}
Choice outsider_choice(std::size_t i) {
  return choice_of(outsiders()[i % outsiders().size()]);
}

// Whether the charge of a free specimen depends on it.
bool shows_in_charge(const Choice& choice) {
  using enum model::Family;
  return choice.family == kinetics || choice.family == polarization || choice.family == drive ||
         choice.family == charge_sensor;
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

// Each in turn, on every second round with one of the others.
std::vector<Choice> choose_physics(const Bench& bench, const BenchOptions& options, Draw& draw) {
  std::vector<Choice> all;
  for (const auto& p : other_physics())
    if (const auto choice = choice_of(p); !options.charge_only || shows_in_charge(choice))
      all.push_back(choice);
  const auto index = static_cast<std::size_t>(bench.index), turn = index + bench.seed;
  std::vector<Choice> out{all[turn % all.size()]};
  if (index / all.size() % 2 == 1) out.push_back(all[(turn + 1 + draw.below(all.size() - 1)) % all.size()]);
  return out;
}

std::vector<Choice> choose(const Bench& bench, const std::vector<Choice>& physics,
                           const BenchOptions& options, Draw& draw) {
  const std::size_t turn = static_cast<std::size_t>(bench.index) * 7 + bench.seed * 13;
  const auto fits = [&](const Choice& c) {
    return (!options.charge_only || shows_in_charge(c)) &&
           std::ranges::all_of(physics, [&](const Choice& p) { return collision(p.id, c.id).empty(); });
  };
  const auto next = [&](std::size_t from) {
    while (!fits(catalogue_choice(from))) ++from;
    return catalogue_choice(from);
  };
  const auto pair = [&]() -> std::vector<Choice> {
    for (;;) {
      auto a = next(turn), b = catalogue_choice(draw.below(1000));
      if (fits(b) && !clash(a.id, b.id)) return {a, b};
    }
  };
  switch (bench.kind) {
    case Kind::nothing:
    case Kind::moved:
      return {};
    case Kind::single:
    case Kind::withheld:
      return {next(turn)};
    case Kind::outside:
      return {outsider_choice(turn)};
    case Kind::coloured:
      if (bench.index % 2 == 0) return {};
      return {next(draw.below(1000))};
    case Kind::pair:
      return pair();
    case Kind::physics:
      // Of ten benches three have nothing on top, five one effect, two a pair.
      switch (bench.index % 10) {
        case 0:
        case 3:
        case 6:
          return {};
        case 4:
        case 8:
          return pair();
        default:
          return {next(turn)};
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

namespace {

struct Effort {
  int attempts = 3, tries = 12;
};

// An effect of a size drawn between `smallest` and `largest` times `unit`. Some cannot be had in any size:
// after the last attempt whatever it is.
Sized hide(Draw& draw, const Choice& choice, double unit, double smallest, double largest,
           const std::function<double(const model::EffectSetting&)>& size, const Effort& effort = {}) {
  Sized out;
  for (int attempt = 0;
       attempt < effort.attempts && !(out.size > 0.8 * smallest * unit && out.size < 1.5 * largest * unit);
       ++attempt) {
    model::EffectSetting effect{.id = choice.id, .parameters = {}};
    for (const auto& p : choice.parameters)
      effect.parameters.emplace_back(p.name, draw_shape(draw, choice.id, p) * (p.any_sign ? draw.sign() : 1));
    out =
        sized(effect, choice.parameters.front(), unit * draw.decades(smallest, largest), size, effort.tries);
  }
  return out;
}

// Sized by what a recalibration of the base model leaves: two kinds together as one alone, and effects
// against the physics that they come on top of.
void hide_in_physics(Bench& b, Draw& draw, const std::vector<Choice>& physics,
                     const std::vector<Choice>& effects, const Sizing& sizing,
                     const std::array<double, 4>& noise) {
  // Each try is played twice. At the end of its range a kind is as strong as it may be.
  constexpr Effort of_physics{.attempts = 1, .tries = 8}, of_effects{.attempts = 2, .tries = 12};
  Recalibration recalibration(sizing, noise);
  const double wanted = draw.decades(0.2, 5);
  for (const auto& choice : physics) {
    const auto left = [&](const model::EffectSetting& kind) {
      auto all = b.physics;
      all.push_back(kind);
      return recalibration.left(all);
    };
    const bool last = &choice == &physics.back();
    const auto found = hide(draw, choice, last ? wanted : wanted * std::sqrt(0.5), 1, 1, left, of_physics);
    b.physics.push_back(found.effect);
    b.left = found.size;
  }
  recalibration.start_from(b.physics);
  for (const auto& choice : effects) {
    const auto left = [&](const model::EffectSetting& effect) { return recalibration.left({effect}); };
    const auto found = hide(draw, choice, b.left, 2, 30, left, of_effects);
    b.effects.push_back(found.effect);
    b.sizes.push_back(found.size);
  }
}

protocols::Past draw_past(Draw& draw) {
  using enum protocols::PastKind;
  switch (draw.below(3)) {
    case 0:
      return {.kind = poled_minus};
    case 1:
      return {.kind = unpoled};
    default:
      // From saturation part of the way or all of it towards the other side.
      const bool plus = draw.chance(0.5);
      const double level = (plus ? -1 : 1) * draw.between(5e5, 2e6);
      return {.kind = visited,
              .from = plus ? protocols::FirstState::poled_plus : protocols::FirstState::poled_minus,
              .levels = {{.field = level, .seconds = draw.decades(0.3, 10)}}};
  }
}

void keep_three(std::vector<FieldProgram>& programs, Draw& draw) {
  while (programs.size() > 3)
    programs.erase(programs.begin() + 1 + static_cast<std::ptrdiff_t>(draw.below(programs.size() - 1)));
}

}  // namespace

Bench make_bench(std::uint64_t seed, int index, Kind kind, const BenchOptions& options) {
  Draw draw(seed * 1000003 + static_cast<std::uint64_t>(index));
  Bench b;
  b.seed = seed;
  b.index = index;
  b.kind = kind;
  b.coloured = kind == Kind::coloured;
  const auto physics = kind == Kind::physics ? choose_physics(b, options, draw) : std::vector<Choice>();
  const auto choices = choose(b, physics, options, draw);
  b.handed = draw_base(draw);
  if (options.charge_only) b.handed.load = {};
  // Else the effect internal_bias_field would do much of what unequal barriers do.
  if (const bool unequal = std::ranges::find(physics, "switching_asymmetry", &Choice::id) != physics.end();
      unequal && b.handed.polycrystal.bias_field == 0)
    b.handed.polycrystal.bias_field = draw.sign() * draw.between(2e4, 1e5);
  for (const auto& choice : choices) make_absent(b.handed, choice.id);
  b.base = move_parameters(b.handed, draw, kind == Kind::moved ? 1 + static_cast<int>(draw.below(4)) : 0);
  auto programs = draw_programs(draw.generator, draw.between(1.8e6, 2.2e6));
  if (options.few_recordings) keep_three(programs, draw);
  if (options.past) {
    for (auto& p : programs) p.past = draw_past(draw);
    for (const auto& p : programs) b.pasts.push_back(p.past);
  }
  const bool stated = options.past && index % 2 == 0;

  std::vector<std::size_t> channels{0, 1, 2, 3};
  if (options.charge_only) channels.resize(2);
  const Sizing sizing(b.base, programs, channels);
  std::array<double, 4> std = sizing.ranges();
  for (double& v : std) v *= options.low_noise ? draw.decades(1e-4, 2e-4) : draw.decades(1e-3, 5e-3);
  if (kind == Kind::physics) {
    hide_in_physics(b, draw, physics, choices, sizing, std);
  } else {
    for (const auto& choice : choices) {
      const auto found = hide(draw, choice, 1, 1.5, 40,
                              [&](const model::EffectSetting& effect) { return sizing.size(effect, std); });
      b.effects.push_back(found.effect);
      b.sizes.push_back(found.size);
    }
  }
  for (const auto& choice : choices) b.families.emplace_back(model::family_name(choice.family));
  if (kind == Kind::withheld)
    for (const auto& e : named_effects())
      if (e.id != choices[0].id) b.candidates.emplace_back(e.id);

  const bool drive = std::any_of(choices.begin(), choices.end(),
                                 [](const Choice& c) { return c.family == model::Family::drive; });
  const bool command = drive || draw.chance(options.commanded);
  const bool from_first = draw.chance(0.2);
  const auto ranges = sizing.ranges();
  for (const std::size_t c : channels) {
    const auto channel = all_channels.at(c);
    b.noise[channel] = std.at(c);
    b.gain[channel] = 1 + draw.sign() * draw.between(0.01, 0.02);
    b.offset[channel] = draw.sign() * draw.between(0.01, 0.02) * ranges.at(c);
  }
  const int domains = options.domains * (options.low_noise ? quiet_domains : 1);
  double session = 0;
  for (const auto& p : programs) {
    auto hidden = b.physics;
    hidden.insert(hidden.end(), b.effects.begin(), b.effects.end());
    const auto truth = play(loaded(b.base, p), hidden, p.time, p.command,
                            {.domains = domains, .path = 1, .session_time = session, .past = p.past});
    session += p.time.back();
    recordings::Recording r;
    r.header.title = p.name;
    const auto handed = loaded(b.handed, p);
    r.header.specimen = {.name = "",
                         .length = handed.actuator.length,
                         .area = handed.actuator.area,
                         .layer_thickness = handed.actuator.layer_thickness,
                         .layer_count = handed.actuator.layer_count};
    r.header.load = {.spring_stiffness = handed.load.spring_stiffness, .prestress = handed.load.prestress};
    if (stated) r.header.past = p.past;
    r.header.charge_reference =
        from_first ? recordings::ChargeReference::first_sample : recordings::ChargeReference::absolute;
    r.time = p.time;
    if (command) r.set(Channel::command) = p.command;
    for (const std::size_t place : channels) {
      const auto c = all_channels.at(place);
      auto& out = r.set(c);
      const auto& clean = *columns(truth).at(place);
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
