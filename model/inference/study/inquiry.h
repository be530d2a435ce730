// One pass of a discovery, for one split into training and held-out recordings: the selection of effects with
// noise as the only error, a better model where the selected one leaves more than noise, and the proof on the
// held-out recordings.
#pragma once

#include <functional>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "model/inference/study/session.h"

namespace ferrobench::model::inference {

class Inquiry {
 public:
  Inquiry(Session& session, const Model& base);

  // Fills in the session's Discovery. Returns the held-out recordings that the recalibrated base does not
  // explain.
  std::set<std::size_t> run();

 private:
  static constexpr auto gap_without_a_name = "Recalibrated, with terms that narrow a gap that has no name.";

  SimulationOptions fine_for(const Model& base) const;
  // Reports the progress of the next step. How many steps follow depends on what is found, so progress may
  // jump at the end.
  Ticker next_step();
  WorkflowResult select(const Hypothesis& base, bool unless_gross, Eigen::VectorXd start,
                        const SelectionOptions& selection);
  std::optional<Improvement> narrow(const Fit& from, ImprovementTask& task);
  std::vector<const Effect*> candidates_beside(const Model& model) const;
  WhitenedRecordings held_out_residuals(const SimulationOptions& simulation) const;
  ExcessTaken held_out_excess(const WorkflowResult& found) const;
  void improve_gross();
  void compare_explanations();
  void improve_beyond_effects();
  bool name_a_second_effect();
  double squares_at(const Improvement& narrowed) const;
  bool select_beside_corrections(const Improvement& narrowed);
  bool select_beside_tables(const Improvement& narrowed, const std::vector<const Effect*>& named = {});
  bool is_named_beside_terms(const WorkflowResult& again) const;
  void tell_beside_terms(WorkflowResult again, bool named, const SelectionOptions& asked_by);
  void under_pasts_of_base(const std::function<void()>& what);
  void tell_improvement();
  void tell_where();
  std::set<std::size_t> prove();

  Session& s_;
  Hypothesis base_;
  WhitenedRecordings coarse_, fine_;
  WorkflowResult found_;
  std::vector<AddedTerm> terms_;         // empirical terms that are part of the base of `found_`
  std::vector<std::string> untestable_;  // effects that drop_untestable took out before any fit
  std::optional<Improvement> improved_;
  double done_ = 0;     // progress at which the next step begins
  Fit before_, after_;  // the recalibrated base; the model with all that was added
};

}  // namespace ferrobench::model::inference
