#include "tests/daq/usb/session.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/daq/usb/byte_link.h"

namespace ferrobench::daq::usb {
namespace {

TEST(Session, AnyAnswersAreSurvived) {
  std::mt19937_64 random(20);
  std::size_t rows = 0, opened = 0;
  for (int run = 0; run < 3000; ++run) {
    std::vector<std::byte> answers(random() % 4000);
    // Mostly benign bytes reach further than noise does.
    const auto limit = run % 3 == 0 ? 256U : run % 3 == 1 ? 16U : 2U;
    for (auto& b : answers)
      b = static_cast<std::byte>(random() % 50 == 0 ? random() % 256 : random() % limit);
    const auto got = run_session(answers);
    rows += got;
    opened += got > 0 ? 1 : 0;
  }
  EXPECT_GT(opened, 100U);
  EXPECT_GT(rows, 1000U);
}

TEST(Session, NothingAtAllIsSurvived) {
  EXPECT_EQ(run_session({}), 0U);
}

}  // namespace
}  // namespace ferrobench::daq::usb
