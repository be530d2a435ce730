// Several clients that ask one engine for anything in any order, and whether what they were told agrees with
// the model of a bench: the states of a run and what may follow them (server/engine/run.h), one run at a
// time, the output at zero after each, one controller by lease, and for each method the errors that it may
// give.
//
// What is asked is drawn from the seed. Threads take turns as they like, so the same seed gives the same
// questions, not the same answers; everything is kept, and judged when all is over.
//
// With `deaths` the bench is a process, which is killed again and again at any moment: it may end runs, which
// are broken off then, and cost a call its device, and nothing else. A kill is an Ask for bench_death.
#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <ostream>
#include <string>
#include <vector>

#include "server/engine/run.h"

namespace ferrobench::server::states {

// A call. Times are s since the beginning; the call took effect somewhere between them.
struct Ask {
  int client = 0;
  std::string method{};
  nlohmann::json params = nlohmann::json::object();
  std::string lease{};  // presented
  double begin = 0, end = 0;
  std::string error{};  // its name; "" if there was none
  nlohmann::json result{};
};

// What the topic "run" told, in its order.
struct Told {
  RunStatus status{};
  double time = 0;  // when it was looked at
};

struct Figures {
  std::size_t steps = 0, runs = 0;
  std::map<std::string, int> transitions{};  // "running -> paused"
  std::map<std::string, int> answers{};      // "run.start busy"
  std::vector<std::string> failures{};
};
std::ostream& operator<<(std::ostream& out, const Figures& figures);

inline constexpr std::string_view bench_death = "bench.death";

Figures play(std::size_t steps, int clients, std::uint64_t seed, bool deaths = false);

// Adds to figures.failures what cannot be.
void judge(const std::vector<Ask>& asks, const std::vector<Told>& told, Figures& figures);

}  // namespace ferrobench::server::states
