// Items of a batch, each in a process of its own, so many at a time. A process that crashes or is killed
// takes nothing with it: its item is tried once more, and then has that for its result.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "server/batch/work.h"

namespace ferrobench::batch {

// Where an item stands in its folder.
struct Place {
  std::int64_t task = 0;
  std::size_t index = 0;  // in the task
  std::string id;
};

struct RunOptions {
  int slots = 1;    // items at a time
  int threads = 1;  // of each
  std::string log;  // file in log/ that says how long each took: {"item", "seconds", "host", "state"} a line
  // Asked all the time with the number of items that are over; false ends it, and what is under way is not
  // there then.
  std::function<bool(std::size_t over)> go_on;
};

// Those that have no result yet. Whether all have one now.
bool run_items(const BatchFolder& folder, Kind kind, const std::vector<Place>& places,
               const RunOptions& options);

// What a process of run_items() does: the words after the program's name are {"batch", "work", FOLDER, TASK,
// "--item", INDEX, "--threads", N}.
void work_on_item(const BatchFolder& folder, std::int64_t task, std::size_t index, int threads);

}  // namespace ferrobench::batch
