// Laws that the physics obeys whatever its constants.
#include <gtest/gtest.h>

#include "model/physics/barrier.h"
#include "tests/model/random_models.h"

namespace ferrobench::model {
namespace {

TEST(Barrier, ObeysDetailedBalance) {
  for (double force = -6e5; force <= 6e5; force += 7e3) {
    EXPECT_NEAR(barrier_equal_curvature(force, 5e4) - barrier_equal_curvature(-force, 5e4), -force, 1e-6);
    for (const double other : {1.5e-8, 2.5e-8, 3.5e-8})
      EXPECT_NEAR(barrier_unequal_curvature(force, 5e4, 0.3, 2.5e-8, other, false) -
                      barrier_unequal_curvature(force, 5e4, 0.3, 2.5e-8, other, true),
                  -force, 1e-4);
  }
}

TEST(Fractions, StayFractions) {
  Draw draw(5);
  for (int i = 0; i < 10; ++i) {
    Simulator simulator(draw.model());
    simulator.start(0);
    for (int k = 1; k <= 50; ++k) {
      const double time = 0.1 * k;
      double plus = -1, minus = -1;
      ChannelSpans out;
      out.fraction_plus = {&plus, 1};
      out.fraction_minus = {&minus, 1};
      simulator.play(time - simulator.time(), draw.between(-2e6, 2e6), {&time, 1}, out);
      EXPECT_GE(plus, -1e-9);
      EXPECT_GE(minus, -1e-9);
      EXPECT_LE(plus + minus, 1 + 1e-9);
    }
  }
}

}  // namespace
}  // namespace ferrobench::model
