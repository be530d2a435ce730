// usb_driver_mutations [--seconds N] [--seed N]: sessions with a unit whose answers are mutations of answers
// that got far. Ends with exit code 1 and the answers in hex if the driver breaks a promise; a crash or a
// hang shows by itself. Prints how many were run.
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <map>
#include <random>
#include <vector>

#include "tests/daq/usb/session.h"

namespace ferrobench::daq::usb {
namespace {

using Answers = std::vector<std::byte>;
using Random = std::mt19937_64;

// Mostly benign bytes get further than noise does.
Answers fresh(Random& random) {
  Answers out(random() % 4000);
  constexpr std::array<unsigned, 3> limits{2, 16, 256};
  const unsigned limit = limits.at(random() % limits.size());
  for (auto& byte : out)
    byte = static_cast<std::byte>(random() % 50 == 0 ? random() % 256 : random() % limit);
  return out;
}

Answers mutated(Answers answers, const Answers& other, Random& random) {
  for (auto changes = 1 + random() % 8; changes > 0; --changes) {
    const std::size_t at = answers.empty() ? 0 : random() % answers.size();
    const auto where = answers.begin() + static_cast<std::ptrdiff_t>(at);
    switch (answers.empty() ? 1 : random() % 5) {
      case 0:
        answers[at] = static_cast<std::byte>(random() % 256);
        break;
      case 1:
        answers.insert(where, 1 + random() % 16, static_cast<std::byte>(random() % 256));
        break;
      case 2:
        answers.erase(where, where + static_cast<std::ptrdiff_t>(
                                         std::min<std::size_t>(1 + random() % 16, answers.size() - at)));
        break;
      case 3:
        answers[at] ^= static_cast<std::byte>(1U << random() % 8);
        break;
      default:  // the beginning of one, the end of another
        answers.resize(at);
        if (!other.empty())
          answers.insert(answers.end(), other.begin() + static_cast<std::ptrdiff_t>(random() % other.size()),
                         other.end());
    }
  }
  if (answers.size() > 6000) answers.resize(6000);
  return answers;
}

int run(double seconds, std::uint64_t seed) {
  Random random(seed);
  std::map<std::size_t, Answers> best;  // by rows handed on: each number once
  std::uint64_t sessions = 0, with_rows = 0;
  const auto begin = std::chrono::steady_clock::now();
  const auto passed = [&] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  };
  const auto pick = [&]() -> const Answers& {
    return std::next(best.begin(), static_cast<std::ptrdiff_t>(random() % best.size()))->second;
  };
  while (passed() < seconds) {
    const auto answers = best.empty() || random() % 4 == 0 ? fresh(random) : mutated(pick(), pick(), random);
    try {
      const auto rows = run_session(answers);
      with_rows += rows > 0 ? 1 : 0;
      if (rows > 0) best.try_emplace(rows, answers);
    } catch (const std::exception& broken) {
      std::printf("broken: %s\nanswers: ", broken.what());
      for (const auto byte : answers) std::printf("%02x", static_cast<unsigned>(byte));
      std::printf("\n");
      return EXIT_FAILURE;
    }
    if (++sessions % 1000 == 0)
      std::fprintf(stderr, "%llu sessions\r", static_cast<unsigned long long>(sessions));
  }
  std::printf("%llu sessions in %.0f s, %llu handed on rows, %zu different numbers of rows\n",
              static_cast<unsigned long long>(sessions), passed(), static_cast<unsigned long long>(with_rows),
              best.size());
  return EXIT_SUCCESS;
}

}  // namespace
}  // namespace ferrobench::daq::usb

int main(int argc, char** argv) {
  double seconds = 180;
  std::uint64_t seed = 1;
  for (int i = 1; i + 1 < argc; i += 2) {
    if (std::strcmp(argv[i], "--seconds") == 0) seconds = std::atof(argv[i + 1]);
    if (std::strcmp(argv[i], "--seed") == 0) seed = std::strtoull(argv[i + 1], nullptr, 10);
  }
  return ferrobench::daq::usb::run(seconds, seed);
}
