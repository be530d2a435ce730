// A batch from its manifest to the tables of all results: what is to be done, by processes here or by the
// tasks of a job array (slurm.h), and what came of it.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "recordings/disk/durable_file.h"
#include "server/batch/runner.h"

namespace ferrobench::batch {

struct Progress {
  std::string stage;
  std::size_t over = 0, of = 0;  // items that this call does
};

struct BatchOptions {
  int threads = 1;         // of each item
  std::int64_t chunk = 0;  // items of a task; 0: so many that there are at most 1000 tasks
  bool replace = false;    // do again what another commit of ferrobench has done
  std::function<bool(const Progress&)> progress;  // false: no more
};

struct Summary {
  std::size_t done = 0, failed = 0, missing = 0;
};

class Batch {
 public:
  // Writes nothing but a lock. Error(busy) if another command works in the folder, Error(bad_state) if that
  // is of another kind.
  Batch(Kind kind, std::vector<Item> items, const std::filesystem::path& folder, BatchOptions options);

  const BatchFolder& folder() const { return folder_; }
  const BatchOptions& options() const { return options_; }
  const Plan& plan() const { return plan_; }
  bool is_planned() const;  // whether the folder's plan is this one

  // Finds what is to be done, and puts the plan into the folder. What has failed or is outdated is taken
  // away, so that a result that is there counts. Error(bad_state) if results of another commit lie there,
  // unless they are replaced.
  void prepare();
  // Instead of it, while tasks are at work by the same plan.
  void join();

  const std::vector<Place>& to_do() const { return to_do_; }
  std::vector<Place> missing() const;  // of them, by now
  bool tell(const std::string& stage, std::size_t over) const;

  // In processes of this machine, so many items at a time. False if it was stopped.
  bool run_here(int slots) const;
  // The tables and the page of what there is.
  Summary merge() const;

 private:
  template <class Wanted>
  void collect(Wanted wanted);

  Kind kind_;
  std::vector<Item> items_;
  BatchFolder folder_;
  BatchOptions options_;
  Plan plan_;
  recordings::Descriptor lock_;
  std::vector<Place> to_do_;
};

// What a task of a job array does: its items that have no result, one after the other. False if it was
// stopped. Error(bad_state) if this program is not the one that made the plan.
bool work_on_task(const BatchFolder& folder, std::int64_t task, int threads,
                  const std::function<bool()>& stop);

}  // namespace ferrobench::batch
