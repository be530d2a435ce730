// Pulses against closed forms, and against the tester's own figures.
#include "recordings/analysis/pund.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "base/text_file.h"
#include "recordings/exchange/import.h"
#include "recordings/reports/report.h"
#include "tests/recordings/sample.h"

namespace ferrobench::recordings {
namespace {

double number(const Table& table, std::size_t row, const std::string& key) {
  for (std::size_t i = 0; i < table.columns.size(); ++i)
    if (table.columns[i].key == key) return std::get<double>(table.rows.at(row).at(i));
  throw std::runtime_error("no column " + key);
}

constexpr double switched = 0.24, linear = 0.07, back = 0.04;  // C/m^2

// Triangular pulses of these signs. The polarization follows the field by `linear`; a pulse that switches
// adds `switched` on its way up and loses `back` of it on its way down.
Recording pulses(const std::vector<int>& signs) {
  constexpr int half = 100, rest = 50;
  Recording r;
  r.header = testing::sample_header();
  auto &field = r.set(Channel::field), &charge = r.set(Channel::charge);
  const double area = r.header.specimen.area * static_cast<double>(r.header.specimen.layer_count);
  double p = 0;
  int state = 0;
  const auto add = [&](double e, double value) {
    r.time.push_back(static_cast<double>(r.time.size()) * 1e-3);
    field.push_back(2e6 * e);
    charge.push_back(area * (value + linear * e));
  };
  for (const int sign : signs) {
    for (int i = 0; i < rest; ++i) add(0, p);
    const double gain = sign == state ? 0 : sign * switched, loss = sign == state ? 0 : sign * back;
    for (int i = 1; i <= half; ++i) add(sign * i / double{half}, p + gain * i / half);
    p += gain;
    for (int i = half - 1; i >= 0; --i) add(sign * i / double{half}, p - loss * (half - i) / half);
    p -= loss;
    state = sign;
  }
  for (int i = 0; i < rest; ++i) add(0, p);
  return r;
}

TEST(Pund, EachCycleHasWhatWasSwitched) {
  const auto table = pund_table(pulses({-1, 1, 1, -1, -1, 1, 1, -1, -1}));
  ASSERT_TRUE(table);
  ASSERT_EQ(table->rows.size(), 2u);
  for (std::size_t row = 0; row < 2; ++row) {
    EXPECT_NEAR(number(*table, row, "P_C_per_m2"), switched + linear, 1e-12);
    EXPECT_NEAR(number(*table, row, "U_C_per_m2"), linear, 1e-12);
    EXPECT_NEAR(number(*table, row, "N_C_per_m2"), -switched - linear, 1e-12);
    EXPECT_NEAR(number(*table, row, "D_C_per_m2"), -linear, 1e-12);
    EXPECT_NEAR(number(*table, row, "switched_C_per_m2"), switched, 1e-12);
    EXPECT_NEAR(number(*table, row, "non_switched_C_per_m2"), linear, 1e-12);
    EXPECT_NEAR(number(*table, row, "switched_left_C_per_m2"), switched - back, 1e-12);
  }
}

// As testers write them: the preset is up, and the sequence begins with U.
TEST(Pund, TheSequenceMayBeginAnywhere) {
  const auto table = pund_table(pulses({1, 1, -1, -1, 1}));
  ASSERT_TRUE(table);
  ASSERT_EQ(table->rows.size(), 1u);
  EXPECT_NEAR(number(*table, 0, "switched_C_per_m2"), switched, 1e-12);
  EXPECT_FALSE(pund_tester_table(pulses({1, 1, -1, -1, 1})));  // no tester says anything
}

TEST(Pund, CutOffSamplesAreMarked) {
  auto r = pulses({-1, 1, 1, -1, -1});
  r.events.push_back({r.time[400], "clipped", "charge: the converter's range was left"});
  for (const auto& table : {pund_table(r), pulse_table(r)}) {
    ASSERT_TRUE(table);
    EXPECT_FALSE(table->clipped.empty()) << table->key;
  }
}

TEST(Pund, LoopsAreNone) {
  auto r = testing::play(0, {{1.5e6, 1}, {-1.5e6, 2}, {1.5e6, 2}, {-1.5e6, 2}, {0, 1}}, 200);
  r.set(Channel::charge).assign(r.size(), 0);
  EXPECT_FALSE(pund_table(r));
}

std::string measured(const std::string& name) {
  return std::string(FERROBENCH_SOURCE) + "/../shared/data/measured/" + name;
}

class Measured : public ::testing::TestWithParam<const char*> {};
TEST_P(Measured, SwitchedChargeIsTheTesters) {
  const auto path = measured(GetParam());
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "there is no " << path;
  CsvImport import;
  import.csv = read_text_file(path, 64u << 20, ErrorCode::bad_recording);
  for (const auto& made : import_tables(import, std::nullopt)) {
    const auto table = pund_tester_table(made.recording);
    ASSERT_TRUE(table);
    ASSERT_GE(table->rows.size(), 5u);
    for (std::size_t row = 0; row < table->rows.size(); ++row)
      EXPECT_NEAR(number(*table, row, "difference_percent"), 0, 1)
          << std::get<std::string>(table->rows[row][0]);
    EXPECT_TRUE(pund_table(made.recording));
  }
}
INSTANTIATE_TEST_SUITE_P(Pund, Measured, ::testing::Values("aixacct_pund.dat", "aixacct_tfa3000_pund.dat"));

}  // namespace
}  // namespace ferrobench::recordings
