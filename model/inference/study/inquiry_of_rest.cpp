// The part of Inquiry that deals with what the selected effects leave: terms that narrow it, and a repeated
// selection of effects with these terms in the base model.
#include <algorithm>
#include <cmath>

#include "model/inference/parameters/parameters.h"
#include "model/inference/study/inquiry.h"
#include "model/inference/study/validation.h"

namespace ferrobench::model::inference {
namespace {

bool is_correction(const AddedTerm& a) {
  return a.empirical && !find_effect(a.term.id).table;
}

// The share of the sum of squares above the noise's that is gone after; none is known better than by its
// standard deviation.
double share_of_excess(const Fit& before, const Fit& after, double samples) {
  const auto excess = [samples](const Fit& f) {
    return std::max(f.squares - samples, std::sqrt(2 * samples));
  };
  return 1 - excess(after) / excess(before);
}

// The effects' parameters count as the base's last ones from now on.
Hypothesis as_last_of_base(Hypothesis h, const std::vector<const Effect*>& effects) {
  std::stable_partition(h.parameters.begin(), h.parameters.end(), [&](const ScaledParameter& p) {
    return std::ranges::none_of(effects, [&](const Effect* e) { return is_of_effect(p.path, e->id); });
  });
  h.base_count = h.parameters.size();
  return h;
}

// Effects whose parameters are the base's last ones become a part of each explanation.
void count_among_effects(ForwardSelection& found, const std::vector<const Effect*>& effects) {
  std::size_t parameters = 0;
  for (const auto* e : effects) parameters += e->parameters.size();
  for (auto& t : found.trials) {
    t.effects.insert(t.effects.begin(), effects.begin(), effects.end());
    t.fit.hypothesis.base_count -= parameters;
  }
}

// The base with the corrections that narrow its gap, whose numbers are its own from now on.
Hypothesis with_corrections(Hypothesis base, const Model& narrowed,
                            const std::vector<AddedTerm>& corrections) {
  for (const auto& a : corrections) {
    const auto& effect = find_effect(a.term.id);
    std::vector<double> values;
    for (const auto& p : effect.parameters)
      values.push_back(get_parameter(narrowed, effect_path(a.term.id, p.name)));
    base = with_effect(base, effect, values);
  }
  base.base_count = base.parameters.size();
  return base;
}

}  // namespace

// Where nothing could be named, or what was named leaves a material rest.
void Inquiry::improve_beyond_effects() {
  if (found_.selection.verdict == Verdict::nothing_missing || found_.selection.sufficient) return;
  const bool unknown = s_.out.verdict == Verdict::unknown;
  if (!unknown && !is_material(fine_, after_.hypothesis, after_.z, s_.options.floor)) return;
  if (!unknown && name_a_second_effect()) return;
  auto task = improvement_task(s_, fine_.simulation());
  std::erase_if(task.corrections, [this](const Effect* e) {
    return std::ranges::any_of(terms_, [e](const AddedTerm& a) { return a.term.id == e->id; });
  });
  if (unknown)
    task.noise_only = &coarse_;
  else
    task.named = s_.out.added;
  task.tables_beside_corrections = !unknown || !terms_.empty();
  auto improved = narrow(after_, task);
  if (improved && !task.tables_beside_corrections && std::ranges::any_of(improved->added, is_correction)) {
    if (select_beside_corrections(*improved)) return improve_beyond_effects();
    task.tables_beside_corrections = true;
    improved = narrow(after_, task);
  }
  if (improved && unknown && select_beside_tables(*improved)) return;
  if (!improved || improved->added.size() == task.named.size()) return;
  // Beside named effects the terms were fitted with a model error, and with gains and offsets as stated. With
  // noise as the only error that fit may be worse than the one of the named effects; then it is dropped.
  if (unknown || squares_at(*improved) < after_.squares) improved_ = std::move(improved);
}

// Looks for a second effect beside the one that is named. Parameters of the base may have absorbed part of
// it, so that it missed its share of what the first effect leaves. So that rest is narrowed like a gap
// without a name, with the first effect in the base, and effects are selected again beside the empirical
// terms that were added. Returns whether a second effect is named.
bool Inquiry::name_a_second_effect() {
  if (s_.out.verdict != Verdict::named || found_.best->effects.size() != 1) return false;
  auto task = improvement_task(s_, fine_.simulation());
  task.noise_only = &coarse_;
  task.candidates = candidates_beside(after_.hypothesis.model);
  auto& out = s_.out;
  const auto named = found_.best->effects;
  const double among_rivals = out.explanations.front().probability / (1 - out.probability_unknown);
  const auto stood = pasts_of(s_.bench);
  const auto improved = narrow(after_, task);
  if (!improved || !select_beside_tables(*improved, named)) {
    if (task.set_pasts) task.set_pasts(stood);
    return false;
  }
  for (auto& e : out.explanations) e.probability *= among_rivals;
  out.probability_unknown = 1 - among_rivals * (1 - out.probability_unknown);
  return true;
}

// Of the residual and the priors, by noise alone and the fine simulation, as those of a fit are.
double Inquiry::squares_at(const Improvement& narrowed) const {
  return fine_.evaluate(narrowed.hypothesis, narrowed.z).squaredNorm() +
         prior_squares(narrowed.hypothesis, narrowed.z);
}

// Whether an effect is named that was selected with empirical terms in the base. It must be sufficient, and
// it must take the material share of the excess that these terms leave, since they only approximate the
// physics that they stand for.
bool Inquiry::is_named_beside_terms(const WorkflowResult& again) const {
  return again.best != nullptr && again.selection.sufficient &&
         share_of_excess(again.base, again.best->fit, coarse_.samples()) >= s_.selection.material_share;
}

// Repeats the workflow with the corrections of the kinetics that narrowed the gap as part of the base. This
// base is recalibrated from the given values, since it may have another minimum, and effects are selected
// beside it, since the wrong base may have hidden them. The result replaces `found_` unless its sum of
// squares is larger than that of the narrowed model. Returns whether it does.
bool Inquiry::select_beside_corrections(const Improvement& narrowed) {
  std::vector<AddedTerm> corrections;
  std::ranges::copy_if(narrowed.added, std::back_inserter(corrections), is_correction);
  const double stood = squares_at(narrowed);
  auto again = select(with_corrections(base_, setting_at(narrowed.hypothesis, narrowed.z).model, corrections),
                      false, {}, s_.selection);
  const bool named = is_named_beside_terms(again);
  if ((named ? again.best->fit : again.base).squares > stood) return false;
  terms_ = std::move(corrections);
  tell_beside_terms(std::move(again), named, s_.selection);
  return true;
}

// An effect that did not take its share of the gap may have shared the gap with physics that has no name.
// Where both effects and empirical terms narrow the gap, the terms become part of the base, the effects are
// taken out, and the workflow is repeated from there. The terms only approximate that physics, so an effect
// is sufficient beside them if it takes the material share of what they leave. Effects in `named` stay in the
// base and are reported together with the new one. Returns whether an effect is named.
bool Inquiry::select_beside_tables(const Improvement& narrowed, const std::vector<const Effect*>& named) {
  Hypothesis base = narrowed.hypothesis;
  std::vector<AddedTerm> tables;
  for (const auto& a : narrowed.added)
    if (a.empirical)
      tables.push_back(a);
    else
      base = without_effect(std::move(base), a.term.id);
  if (tables.empty() || tables.size() == narrowed.added.size()) return false;
  base = as_last_of_base(std::move(base), named);
  auto selection = s_.selection;
  selection.relative_remainder = 1 - selection.material_share;
  auto again = select(base, false, carried_over(base, narrowed.hypothesis, narrowed.z), selection);
  if (!is_named_beside_terms(again)) return false;
  const bool is_alone = again.best->effects.size() == 1;
  if (!named.empty() && !is_alone) return false;
  const auto held_out = held_out_excess(again);
  if (held_out.left > (1 - s_.selection.material_share) * held_out.before) return false;
  const double share = share_of_excess(again.base, again.best->fit, coarse_.samples());
  std::ranges::move(tables, std::back_inserter(terms_));
  count_among_effects(again.forward, named);
  tell_beside_terms(std::move(again), true, selection);
  if (is_alone) {
    s_.out.added.back().share = share;
    if (held_out.before > 0) s_.out.added.back().share_held_out = held_out.share();
  }
  return true;
}

void Inquiry::tell_beside_terms(WorkflowResult again, bool named, const SelectionOptions& asked_by) {
  found_ = std::move(again);
  after_ = named ? found_.best->fit : found_.base;
  auto& out = s_.out;
  if (named) {
    out.not_testable = untestable_;
    summarize(found_, asked_by, out);
    compare_explanations();
  }
  estimate_terms(after_, after_.hypothesis, after_.z, s_.selection.likelihood_tempering, terms_);
  out.added.insert(out.added.begin(), terms_.begin(), terms_.end());
  out.recalibrated = recalibrations(after_, s_.selection);
  for (const auto& a : terms_)
    std::erase_if(out.recalibrated, [&](const auto& r) { return is_of_effect(r.first, a.term.id); });
  out.recalibrated_base = model_at(before_, "Recalibrated.");
  out.improved =
      model_at(after_, named ? "Recalibrated, with what was found missing and terms that have no name."
                             : gap_without_a_name);
}

}  // namespace ferrobench::model::inference
