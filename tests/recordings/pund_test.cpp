// Pulses and first-order reversal curves against closed forms, and against the tester's own figures.
#include "recordings/analysis/pund.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <numbers>

#include "base/text_file.h"
#include "recordings/analysis/forc.h"
#include "recordings/exchange/import.h"
#include "recordings/reports/figures.h"
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

// P(E_r, E) = -2 A F(E_r) G(E) with dF = f, dG = g, so that rho = A f g.
double bell(double x, double middle, double width) {
  return std::exp(-std::pow((x - middle) / width, 2) / 2) / (width * std::sqrt(2 * std::numbers::pi));
}
double rise(double x, double middle, double width) {
  return std::erfc(-(x - middle) / width / std::numbers::sqrt2) / 2;
}
constexpr double upper = 2e6, e_r = -0.4e6, e_c = 0.5e6, spread = 0.5e6, amplitude = 0.3;

Recording forc_recording(double drift) {
  std::vector<testing::Step> steps;
  for (int k = 0; k < 40; ++k) {
    steps.push_back({1.6e6 - k * 0.09e6, 0.5});
    steps.push_back({upper, 0.5});
  }
  auto r = testing::play(upper, steps, 800);
  auto& charge = r.set(Channel::charge);
  const auto& field = r.at(Channel::field);
  const double area = r.header.specimen.area * static_cast<double>(r.header.specimen.layer_count);
  double reversal = upper;
  for (std::size_t i = 0; i < field.size(); ++i) {
    const bool falling = i == 0 || field[i] < field[i - 1];
    if (falling) reversal = field[i];
    charge.push_back(area * (-2 * amplitude * rise(reversal, e_r, spread) * rise(field[i], e_c, spread) +
                             drift * r.time[i]));
  }
  return r;
}

std::optional<Forc> forc_of(const Recording& r) {
  return find_forc(r, find_cycles(r, turning_points(r)));
}

// Where all points around are there; the polynomials smooth the peak by a few percent.
TEST(Forc, TheDensityIsThatOfTheLaw) {
  const auto forc = forc_of(forc_recording(0));
  ASSERT_TRUE(forc);
  ASSERT_EQ(forc->reversal.size(), 40u);
  const double peak = amplitude * bell(e_r, e_r, spread) * bell(e_c, e_c, spread);
  std::size_t seen = 0;
  for (std::size_t k = 4; k + 4 < forc->reversal.size(); ++k)
    for (std::size_t i = 4; i + 4 < forc->field.size(); ++i) {
      if (std::isnan(forc->density[k][i]) || forc->field[i] < forc->reversal[k] + 0.7e6) continue;
      ++seen;
      EXPECT_NEAR(forc->density[k][i],
                  amplitude * bell(forc->reversal[k], e_r, spread) * bell(forc->field[i], e_c, spread),
                  0.1 * peak)
          << forc->reversal[k] << ' ' << forc->field[i];
    }
  EXPECT_GT(seen, 200u);
}

TEST(Forc, ADriftFromCurveToCurveDoesNoHarm) {
  const auto still = forc_of(forc_recording(0)), drifting = forc_of(forc_recording(1e-3));
  ASSERT_TRUE(still && drifting);
  const double peak = amplitude * bell(e_r, e_r, spread) * bell(e_c, e_c, spread);
  for (std::size_t k = 0; k < still->reversal.size(); ++k)
    for (std::size_t i = 0; i < still->field.size(); ++i) {
      if (std::isnan(still->density[k][i])) continue;
      EXPECT_NEAR(still->density[k][i], drifting->density[k][i], 0.02 * peak);
    }
}

TEST(Forc, AReportHasTheFamilyAndTheMap) {
  const auto figures = make_figures(forc_recording(0));
  const auto map = std::ranges::find_if(figures, [](const Figure& f) { return f.map.has_value(); });
  ASSERT_NE(map, figures.end());
  EXPECT_EQ(map->note, "second-degree polynomials over 7 × 7 points");
  EXPECT_EQ(map->map->z.size(), 40u);
  EXPECT_EQ(std::prev(map)->series.size(), 40u);
  const auto drawing = draw({*map});
  if (drawing.problem.empty())
    EXPECT_NE(drawing.svg.front().find("polygon"), std::string::npos);
  else
    EXPECT_EQ(drawing.problem, "gnuplot is not installed");
}

TEST(Forc, OrdinaryLoopsAreNone) {
  std::vector<testing::Step> steps;
  for (int k = 0; k < 12; ++k) {
    steps.push_back({-1.5e6, 0.5});
    steps.push_back({1.5e6, 0.5});
  }
  auto r = testing::play(1.5e6, steps, 200);
  r.set(Channel::charge).assign(r.size(), 0);
  EXPECT_FALSE(forc_of(r));
}

TEST(Forc, OfACapacitorAsMeasured) {
  const auto path = measured("b1500_forc.csv");
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "there is no " << path;
  CsvImport import;
  import.csv = read_text_file(path, 64u << 20, ErrorCode::bad_recording);
  import.area = 1e-9;
  import.layer_thickness = 1e-8;
  import.length = 1e-8;
  const auto forc = forc_of(import_tables(import, std::nullopt).front().recording);
  ASSERT_TRUE(forc);
  EXPECT_EQ(forc->reversal.size(), 39u);
}

}  // namespace
}  // namespace ferrobench::recordings
