// Slurm: a batch as one job array, by the commands sbatch and squeue alone; accounting is not needed.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "server/batch/batch.h"

namespace ferrobench::batch {

struct SlurmOptions {
  std::string partition, time;       // as sbatch takes them; "": not given
  std::vector<std::string> options;  // further ones of sbatch, one each
  bool wait = true;
};

struct SlurmEnd {
  std::string job;  // the last one; "" if there was nothing to do
  // Whether tasks of it are still at work: the caller was told to stop, or not to wait.
  bool goes_on = false;
  bool cancelled = false;  // somebody has cancelled tasks
};

// Whether tasks of the folder's last array wait or run. False where there is no Slurm.
bool is_at_work(const BatchFolder& folder);

// Prepares the batch and submits an array of the tasks that have something to do, or joins the one that is at
// work by the same plan; waits for its end, and submits what is missing then, for as long as an array has
// brought anything and nobody has cancelled it. Tasks of lost machines are begun again by Slurm itself
// (--requeue). Error(device_unavailable) if there is no Slurm, Error(bad_state) with what sbatch says if it
// refuses.
SlurmEnd run_by_slurm(Batch& batch, const SlurmOptions& options);

// "0-2,7": what sbatch takes for --array. In order and without doubles.
std::string array_of(const std::vector<Place>& places);

}  // namespace ferrobench::batch
