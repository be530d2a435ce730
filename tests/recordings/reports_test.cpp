// Reports against closed forms.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <limits>
#include <numbers>
#include <random>

#include "base/error.h"
#include "recordings/analysis/creep.h"
#include "recordings/analysis/cycles.h"
#include "recordings/analysis/loop_measures.h"
#include "recordings/analysis/segments.h"
#include "recordings/reports/plot.h"
#include "recordings/reports/report.h"
#include "tests/recordings/sample.h"

namespace ferrobench::recordings {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr double pi = std::numbers::pi;

void add_noise(std::vector<double>& values, double deviation, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, deviation);
  for (auto& v : values) v += normal(random);
}

double number(const Table& table, std::size_t row, const std::string& key) {
  for (std::size_t i = 0; i < table.columns.size(); ++i)
    if (table.columns[i].key == key) return std::get<double>(table.rows.at(row).at(i));
  throw std::runtime_error("no column " + key);
}

// E = E0 cos wt, x = x0 cos(wt - d), Q = nA P0 cos(wt - d): ellipses.
Recording ellipse(double delay, int periods, int samples) {
  Recording r;
  r.header = testing::sample_header();
  auto &field = r.set(Channel::field), &x = r.set(Channel::displacement), &q = r.set(Channel::charge);
  for (int i = 0; i <= periods * samples; ++i) {
    const double phase = 2 * pi * i / samples;
    r.time.push_back(i * 1e-3);
    field.push_back(1e6 * std::cos(phase));
    x.push_back(1e-5 * std::cos(phase - delay));
    q.push_back(2.5e-3 * 0.3 * std::cos(phase - delay));
  }
  return r;
}

TEST(Hysteresis, EllipseHasItsAreaWidthAndIntercepts) {
  const double d = 0.4;
  const auto table = hysteresis_table(ellipse(d, 3, 2000));
  ASSERT_TRUE(table);
  ASSERT_EQ(table->rows.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(number(*table, i, "displacement_area_um_kV_per_mm"), pi * 10 * std::sin(d), 0.01);
    EXPECT_NEAR(number(*table, i, "energy_J_per_m3"), pi * 1e6 * 0.3 * std::sin(d), 10);
    EXPECT_NEAR(number(*table, i, "width_kV_per_mm"), 2 * std::sin(d), 1e-3);
    EXPECT_NEAR(number(*table, i, "coercive_negative_kV_per_mm"), -std::sin(d), 1e-3);
    EXPECT_NEAR(number(*table, i, "coercive_positive_kV_per_mm"), std::sin(d), 1e-3);
    EXPECT_NEAR(number(*table, i, "remanent_falling_C_per_m2"), 0.3 * std::sin(d), 1e-3);
    EXPECT_NEAR(number(*table, i, "remanent_rising_C_per_m2"), -0.3 * std::sin(d), 1e-3);
  }
}

TEST(Hysteresis, BothWingsOfAButterflyCount) {
  auto r = ellipse(0.3, 1, 4000);
  auto& x = r.set(Channel::displacement);
  for (const double p : r.at(Channel::charge)) x.push_back(1e-5 * std::pow(p / (2.5e-3 * 0.3), 2));
  const auto table = hysteresis_table(r);
  // x = 10 um cos^2(u - d), E = cos u: the wings are mirror images, which the signed integral would cancel.
  double area = 0;
  for (int i = 0; i < 100000; ++i) {
    const double e = -1 + 2 * (i + 0.5) / 100000, u = std::acos(e);
    area += std::abs(std::pow(std::cos(u - 0.3), 2) - std::pow(std::cos(-u - 0.3), 2)) * 2 / 100000;
  }
  EXPECT_NEAR(number(*table, 0, "displacement_area_um_kV_per_mm"), 10 * area, 0.02);
}

TEST(Stroke, TrianglesOfALinearActuator) {
  auto r = testing::play(0, {{1.5e6, 3}, {0, 3}, {1.5e6, 0.3}, {0, 0.3}}, 1000);
  auto& x = r.set(Channel::displacement);
  for (const double e : r.at(Channel::command)) x.push_back(8e-12 * e);
  const auto stroke = stroke_table(r);
  ASSERT_EQ(stroke->rows.size(), 3u);  // two cycles and the whole
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(number(*stroke, i, "stroke_um"), 12, 1e-9);
  const auto rates = rate_table(r);
  ASSERT_TRUE(rates);
  EXPECT_NEAR(number(*rates, 0, "rate_V_per_s"), 50, 1e-6);
  EXPECT_NEAR(number(*rates, 1, "rate_V_per_s"), 500, 1e-6);
  EXPECT_NEAR(number(*rates, 1, "stroke_um"), 12, 1e-9);
}

// As a damaged file may hold: rates of which a hundredth more is no more.
TEST(Stroke, RatesAtTheEndsOfTheirRangeAreCounted) {
  auto r = testing::play(0, {{1.5e6, 3}, {0, 3}, {1.5e6, 0.3}, {0, 0.3}}, 1000);
  r.set(Channel::displacement) = r.at(Channel::command);
  for (auto& row : r.segments)
    row.rate = row.rate > 1e6 ? INFINITY : std::numeric_limits<double>::denorm_min();
  const auto rates = rate_table(r);
  ASSERT_TRUE(rates);
  EXPECT_EQ(rates->rows.size(), 2u);
}

TEST(Stroke, NoiseBarelyWidensIt) {
  auto r = testing::play(0, {{1.5e6, 3}, {0, 3}}, 1000);
  auto& x = r.set(Channel::displacement);
  for (const double e : r.at(Channel::command)) x.push_back(8e-12 * e);
  add_noise(x, 5e-8, 3);
  const auto table = stroke_table(r);
  EXPECT_NEAR(number(*table, 0, "stroke_um"), 12, 0.05);  // largest minus smallest sample: 0.2 too much
  EXPECT_THAT(table->notes, ::testing::Contains(HasSubstr("parabolas")));
}

TEST(MinorLoops, EveryReversalIsListed) {
  auto r = testing::play(1.5e6, {{1e6, 1}, {1.5e6, 1}, {5e5, 2}, {1.5e6, 2}, {0, 3}, {1.5e6, 3}}, 500);
  auto& x = r.set(Channel::displacement);
  for (const double e : r.at(Channel::command)) x.push_back(1e-11 * e);
  const auto table = minor_loop_table(r);
  ASSERT_EQ(table->rows.size(), 5u);
  EXPECT_NEAR(number(*table, 0, "turning_point_kV_per_mm"), 1, 1e-9);
  EXPECT_NEAR(number(*table, 0, "stroke_um"), 5, 1e-6);
  EXPECT_NEAR(number(*table, 2, "turning_point_kV_per_mm"), 0.5, 1e-9);
  EXPECT_NEAR(number(*table, 2, "stroke_um"), 10, 1e-6);
  EXPECT_NEAR(number(*table, 4, "stroke_um"), 15, 1e-6);
  EXPECT_EQ(Analysis(r).cycles().size(), 3u);
}

Recording creep_recording(const std::function<double(double)>& creep, double noise) {
  auto r = testing::play(1.5e6, {{-5e5, 2}, {-5e5, 15}, {1.5e6, 2}}, 200);
  auto& x = r.set(Channel::displacement);
  for (const double t : r.time) x.push_back(t <= 2 ? 0 : creep(std::min(t, 17.0) - 2));
  if (noise > 0) add_noise(x, noise, 5);
  r.noise.at(3) = noise;
  return r;
}

Creep creep_of(const Recording& r) {
  const auto holds = find_holds(r);
  EXPECT_EQ(holds.size(), 1u);
  return measure_creep(r, signal(r, Channel::displacement), holds.at(0));
}

TEST(CreepReport, ExponentialIsHalfDoneAtItsHalfTime) {
  const auto law = [](double t) { return -4e-6 * (1 - std::exp(-t / 2)); };
  // Half of the change within the 15 s.
  const double half = -2 * std::log(1 - 0.5 * (1 - std::exp(-7.5)));
  const auto exact = creep_of(creep_recording(law, 0));
  EXPECT_NEAR(exact.change.value, law(15), 1e-12);
  EXPECT_NEAR(exact.range, -law(15), 1e-12);
  EXPECT_NEAR(*exact.time_to_half, half, 1e-4);
  const auto noisy = creep_of(creep_recording(law, 3e-8));
  EXPECT_NEAR(noisy.change.value, law(15), 0.02 * 4e-6);
  EXPECT_NEAR(noisy.range, -law(15), 0.03 * 4e-6);
  EXPECT_NEAR(*noisy.time_to_half, half, 0.06);
}

TEST(CreepReport, LogarithmicHasItsRate) {
  const auto law = [](double t) { return 3e-7 * std::log10(1 + t / 1e-4); };
  EXPECT_NEAR(creep_of(creep_recording(law, 0)).per_decade->value, 3e-7, 1e-9);
  EXPECT_NEAR(creep_of(creep_recording(law, 1e-8)).per_decade->value, 3e-7, 1.5e-8);
}

TEST(CreepReport, ReadingsAreSpacedByTheLogarithmOfTime) {
  const auto law = [](double t) { return 3e-7 * std::log10(1 + t); };
  const std::vector<double> times{0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10};
  for (const double noise : {0.0, 2e-9}) {
    const auto r = creep_recording(law, noise);
    const auto tables = creep_readings(r);
    ASSERT_EQ(tables.size(), 1u);
    const auto& table = tables.front();
    ASSERT_EQ(table.columns.size(), 3 + times.size());
    EXPECT_EQ(table.columns[3].key, "after_0.02_s_um");
    ASSERT_EQ(table.rows.size(), 1u);
    for (std::size_t k = 0; k < times.size(); ++k) {
      const double u = noise > 0 ? table.uncertainty.at({0, 3 + k}) : 0;
      EXPECT_NEAR(std::get<double>(table.rows[0][3 + k]), 1e6 * law(times[k]), 3 * u + 1e-6) << times[k];
      EXPECT_LT(u, 1e6 * 2 * noise + 1e-12);
    }
  }
}

TEST(CreepReport, RangeSeesWhatComesBack) {
  const auto creep = creep_of(creep_recording([](double t) { return 1e-6 * std::sin(2 * pi * t / 15); }, 0));
  EXPECT_NEAR(creep.change.value, 0, 1e-12);
  EXPECT_NEAR(creep.range, 2e-6, 1e-9);
}

TEST(Segments, AreFoundInANoisyField) {
  auto r = testing::play(0, {{1.5e6, 3}, {1.5e6, 2}, {-4.5e5, 3.9}, {-4.5e5, 15}, {1.5e6, 3.9}}, 200);
  const auto truth = std::exchange(r.segments, {});
  r.channels.at(static_cast<std::size_t>(Channel::command)).reset();
  add_noise(*r.channels.at(static_cast<std::size_t>(Channel::field)), 1e3, 9);
  const auto found = infer_segments(r);
  ASSERT_EQ(found.size(), truth.size());
  for (std::size_t i = 0; i < truth.size(); ++i) {
    EXPECT_EQ(found[i].kind, truth[i].kind);
    EXPECT_NEAR(static_cast<double>(found[i].end_sample), static_cast<double>(truth[i].end_sample), 2) << i;
    EXPECT_NEAR(found[i].level, truth[i].level, 2e3) << i;
    EXPECT_NEAR(found[i].rate, truth[i].rate, 0.01 * 5e5) << i;
  }
}

// Short steep ramps between long holds, one of 6 samples, in a noise of 4 % of its height.
TEST(Segments, AreFoundWhereRampsAreShort) {
  auto r =
      testing::play(0, {{-4e5, 0.06}, {-4e5, 7.4}, {1.8e6, 0.43}, {-6e5, 0.47}, {-6e5, 7.4}, {0, 0.12}}, 100);
  const auto truth = std::exchange(r.segments, {});
  r.channels.at(static_cast<std::size_t>(Channel::command)).reset();
  const auto clean = r.at(Channel::field);
  for (unsigned seed = 1; seed <= 40; ++seed) {
    r.set(Channel::field) = clean;
    add_noise(*r.channels.at(static_cast<std::size_t>(Channel::field)), 1.5e4, seed);
    const auto found = infer_segments(r);
    ASSERT_EQ(found.size(), truth.size()) << seed;
    for (std::size_t i = 0; i < truth.size(); ++i) {
      EXPECT_EQ(found[i].kind, truth[i].kind) << seed << ' ' << i;
      EXPECT_NEAR(static_cast<double>(found[i].end_sample), static_cast<double>(truth[i].end_sample), 1)
          << seed << ' ' << i;
    }
  }
}

// How often a ramp of 60 samples is cut, straight or with a bend of 1.5 standard deviations of the noise.
TEST(Segments, SlightBendsAreCutWhereAskedFor) {
  const auto cut = [](double bend_at, double bend) {
    auto r = testing::play(0, {{bend_at, 0.3}, {1.8e6, 0.3}, {1.8e6, 2}}, 100);
    r.segments.clear();
    r.channels.at(static_cast<std::size_t>(Channel::command)).reset();
    const auto clean = r.at(Channel::field);
    int count = 0;
    for (unsigned seed = 1; seed <= 200; ++seed) {
      r.set(Channel::field) = clean;
      add_noise(*r.channels.at(static_cast<std::size_t>(Channel::field)), 1.5e4, seed);
      count += infer_segments(r, bend).size() > 2 ? 1 : 0;
    }
    return count;
  };
  constexpr double never = std::numeric_limits<double>::infinity();
  EXPECT_EQ(cut(9e5, never), 0);
  EXPECT_EQ(cut(9e5 + 2.25e4, never), 0);
  EXPECT_LT(cut(9e5, 8), 40);
  EXPECT_GT(cut(9e5 + 2.25e4, 8), 160);
}

Recording hostile_names() {
  auto r = creep_recording([](double t) { return 1e-7 * t; }, 0);
  r.header.title = "<script>alert(1)</script>";
  r.header.specimen.name = "\"><img src=x onerror=y>";
  r.segments[1].label = "<b>hold</b>";
  r.events = {{1, "<i>", "=cmd()|a,\"b\"\nnext"}};
  r.set(Channel::charge).assign(r.size(), 1e-4);
  return r;
}

TEST(Render, HtmlIsOnePageWithNothingOfTheFileUnescaped) {
  const auto r = hostile_names();
  const auto page = render(make_report(r), Format::html);
  for (const auto* forbidden :
       {"<script", "<img", "<b>hold", "<i>", "<link", "@import", "url(http", "xlink:href='http"})
    EXPECT_THAT(page, Not(HasSubstr(forbidden)));
  EXPECT_THAT(page, HasSubstr("&lt;script&gt;"));
  EXPECT_THAT(page, ::testing::StartsWith("<!doctype html>"));
  EXPECT_TRUE(page.find("<svg") != std::string::npos ||
              page.find("No picture: gnuplot is not installed") != std::string::npos);
}

TEST(Render, ALogarithmicAxisIsNumberedByPowersOfTen) {
  const Series line{.label = "", .points = {{1e-4, 0}, {600, 1}}};
  const auto drawing = draw({{.title = "t", .x_label = "x", .y_label = "y", .log_x = true, .series = {line}},
                             {.title = "t", .x_label = "x", .y_label = "y", .series = {line}}});
  if (drawing.problem == "gnuplot is not installed") GTEST_SKIP() << drawing.problem;
  ASSERT_EQ(drawing.problem, "");
  EXPECT_THAT(drawing.svg[0], HasSubstr(">-4<"));
  EXPECT_THAT(drawing.svg[0], Not(HasSubstr("0.0001")));
  EXPECT_THAT(drawing.svg[1], HasSubstr(" 600<")) << "the next one has decimals again";
}

TEST(Render, StartsOfShortCyclesAreToldApart) {
  Table table{.key = "k", .title = "t", .columns = {{"start_s", "start", "s"}}, .rows = {}, .notes = {}};
  for (const double start : {0.0, 1200.024, 1200.464, 1200.904}) table.add({start});
  const auto text = to_text(table);
  for (const auto* start : {"1200.02", "1200.46", "1200.9"}) EXPECT_THAT(text, HasSubstr(start));
  EXPECT_THAT(to_csv(table), HasSubstr("1200.464\n"));
}

TEST(Render, MissingGnuplotIsSaid) {
  const auto drawing =
      draw({{.title = "t", .x_label = "x", .y_label = "y", .series = {{"", {{0, 0}, {1, 1}}}}}},
           "/nowhere/gnuplot");
  EXPECT_EQ(drawing.problem, "gnuplot is not installed");
}

TEST(Reports, WhoDrawsInheritsNothingAndIsGivenUpWithAllThatItStarted) {
  char folder[] = "/tmp/drawing-XXXXXX";
  ASSERT_NE(mkdtemp(folder), nullptr);
  const std::filesystem::path place(folder);
  const auto script = [&](const std::string& text, std::chrono::seconds patience) {
    const auto path = place / "gnuplot";
    std::ofstream(path) << "#!/bin/sh\n" << text;
    std::filesystem::permissions(path, std::filesystem::perms::owner_all);
    return draw({{.title = "t", .x_label = "x", .y_label = "y", .series = {{"", {{0, 0}, {1, 1}}}}}},
                path.string(), patience)
        .problem;
  };
  // Without O_CLOEXEC, as a careless library opens it.
  const int open_here = open((place / "ours").c_str(), O_RDWR | O_CREAT, 0600);
  ASSERT_GE(open_here, 3);
  EXPECT_EQ(script("ls -l /proc/$$/fd >" + (place / "fds").string() + "; exit 1\n", std::chrono::seconds(30)),
            "gnuplot failed");
  std::ifstream fds(place / "fds");
  const std::string inherited{std::istreambuf_iterator<char>(fds), {}};
  EXPECT_THAT(inherited, HasSubstr("/dev/null"));
  EXPECT_THAT(inherited, Not(HasSubstr("/ours")));
  close(open_here);

  const auto begin = std::chrono::steady_clock::now();
  EXPECT_EQ(script("sleep 61 & echo $! >" + (place / "pid").string() + "; wait\n", std::chrono::seconds(5)),
            "gnuplot took longer than 5 s");
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(30));
  int pid = 0;
  std::ifstream(place / "pid") >> pid;
  ASSERT_GT(pid, 0);
  for (int i = 0; i < 100 && kill(pid, 0) == 0; ++i) usleep(10'000);
  std::ifstream state("/proc/" + std::to_string(pid) + "/stat");
  const std::string text{std::istreambuf_iterator<char>(state), {}};
  EXPECT_TRUE(text.empty() || text.find(") Z ") != std::string::npos) << text;
  std::filesystem::remove_all(place);
}

TEST(Render, EveryFormatCarriesTheTables) {
  const auto r = hostile_names();
  const auto report = make_report(r);
  const auto json = nlohmann::json::parse(render(report, Format::json));
  EXPECT_NEAR(json["creep"]["rows"][0]["displacement_change_um"].get<double>(), 1.5, 1e-6);
  EXPECT_EQ(json["events"]["rows"][0]["kind"], "<i>");
  const auto csv = render(report, Format::csv);
  EXPECT_THAT(csv, HasSubstr("hold,label,field_kV_per_mm"));
  EXPECT_THAT(csv, HasSubstr("\"'=cmd()|a,\"\"b\"\"\\nnext\""));
  EXPECT_THAT(render(report, Format::md), HasSubstr("## Creep per hold"));
  EXPECT_THAT(render(report, Format::md), Not(HasSubstr("<b>")));
  EXPECT_THAT(render(report, Format::text), HasSubstr("Creep per hold"));
  EXPECT_THROW(format_from_name("pdf"), Error);
}

TEST(Render, AnEmptyRecordingHasAReport) {
  Recording r;
  r.header = testing::sample_header();
  r.set(Channel::field);
  r.set(Channel::displacement);
  for (const auto format : {Format::text, Format::md, Format::csv, Format::json, Format::html})
    EXPECT_NO_THROW(render(make_report(r), format));
}

TEST(Render, GapsAreNotMeasured) {
  auto r = testing::play(0, {{1.5e6, 3}, {0, 3}}, 1000);
  auto& x = r.set(Channel::displacement);
  for (const double e : r.at(Channel::command)) x.push_back(8e-12 * e);
  for (std::size_t i = 100; i < 200; ++i) x[i] = std::nan("");
  const auto table = stroke_table(r);
  EXPECT_NEAR(number(*table, 0, "stroke_um"), 12, 1e-9);
}

}  // namespace
}  // namespace ferrobench::recordings
