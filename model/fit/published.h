// The experiments behind published tables, simulated.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "model/model.h"
#include "model/simulator.h"
#include "protocols/waveform.h"
#include "recordings/tables/comparison.h"

namespace ferrobench::model {

// Of a run; the shipped models take some thousands. A search that strays into models stiffer than that turns
// back.
inline constexpr std::uint64_t most_steps_of_a_run = 20000;

class PublishedExperiments {
 public:
  // `parameters` override those of the protocols (for example rate).
  explicit PublishedExperiments(const std::vector<std::string>& tables,
                                const std::map<std::string, double>& parameters = {});

  // Each table with what the model gives for its cells, in the order of tables().
  std::vector<recordings::Comparison> simulate(const Model& model, const SimulationOptions& options) const;
  // The same, and for each of `parameters` how it changes: one simulation with its derivatives, by which its
  // channels are then moved a little to either side. Of that the cells are algebra, however they are read
  // off.
  struct Neighbours {
    std::vector<recordings::Comparison> below, above;
    double apart = 0;  // in the parameter
  };
  struct Neighbourhood {
    std::vector<recordings::Comparison> here;
    std::vector<Neighbours> by;
  };
  Neighbourhood simulate_around(const Model& model, std::span<const std::string> parameters,
                                const SimulationOptions& options) const;
  std::vector<recordings::PublishedTable> tables() const;
  double duration() const;  // of the longest run, s

  struct Run {
    protocols::Waveform waveform;
    std::optional<double> spring_stiffness, prestress;
  };

 private:
  // Tables of one protocol share its runs.
  struct Group {
    std::string protocol;
    std::vector<Run> runs;
    std::vector<recordings::PublishedTable> tables;
  };
  // A recording without noise for each run of a group.
  using Recorded = std::vector<std::vector<recordings::Recording>>;
  std::vector<recordings::Comparison> compare_all(const Recorded& recorded) const;

  std::vector<Group> groups_;
};

// ln(measured / published), level below 2 % of the published value: a change that passes through zero has no
// logarithm.
double log_error(const recordings::ComparedCell& cell);
// That over how well the cell is known: what residuals of tables are made of.
double weighted_error(const recordings::ComparedCell& cell);

}  // namespace ferrobench::model
