// The searches for sleepers on every instruction set against the plain conditions, with any number of rows.
#include "model/physics/sleepers.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <string>
#include <vector>

#include "model/physics/kernel.h"

namespace ferrobench::model {
namespace {

using Rows = std::vector<std::size_t>;

class Sleepers : public testing::Test {
 protected:
  void TearDown() override { force_kernel_target(""); }

  static std::vector<double> column(std::mt19937_64& random, std::size_t count) {
    std::uniform_real_distribution<double> value(0, 1);
    std::vector<double> out(count + DomainColumns::padding);  // rows past the end would be found if looked at
    for (std::size_t i = 0; i < count; ++i) out[i] = value(random);
    if (count > 3) out[count / 2] = std::numeric_limits<double>::quiet_NaN();
    return out;
  }
  template <class Search>
  static Rows found(std::size_t count, const Search& search) {
    Rows rows(count);
    rows.resize(search(rows.data()));
    return rows;
  }
};

TEST_F(Sleepers, AreFoundAsThePlainConditionsSay) {
  for (const auto& target : kernel_targets()) {
    force_kernel_target("");
    force_kernel_target(target);
    std::mt19937_64 random(3);
    for (const std::size_t count : {0, 1, 3, 7, 8, 9, 64, 101}) {
      SCOPED_TRACE(target + ", " + std::to_string(count) + " rows");
      const auto a = column(random, count), b = column(random, count), c = column(random, count),
                 d = column(random, count);
      const SleepState at{0.4, 0.2, 0.1};
      const std::size_t first = count / 3;
      Rows due, quiet;
      for (std::size_t i = first; i < count; ++i)
        if (!(at.field > a[i] && at.field < 1 - b[i] / 2 && at.stress_path < c[i] && at.time < d[i]))
          due.push_back(i);
      auto high = b;
      for (auto& v : high) v = 1 - v / 2;
      EXPECT_EQ(found(count,
                      [&](std::size_t* rows) {
                        return find_due({a.data(), high.data(), c.data(), d.data()}, first, count, at, rows);
                      }),
                due);
      const QuietLimits limits{0.7, 0.6, 0.9};
      for (std::size_t i = 0; i < count; ++i)
        if (a[i] < limits.falling && b[i] < limits.rising && a[i] + b[i] < limits.sum) quiet.push_back(i);
      EXPECT_EQ(found(count,
                      [&](std::size_t* rows) { return find_quiet(a.data(), b.data(), count, limits, rows); }),
                quiet);
    }
  }
}

}  // namespace
}  // namespace ferrobench::model
