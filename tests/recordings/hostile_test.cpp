// Files that are wrong, damaged or made to mislead: every one is read or refused with the place, none does
// harm.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <functional>
#include <random>

#include "base/error.h"
#include "recordings/file/reader.h"
#include "recordings/file/writer.h"
#include "recordings/hdf5/handle.h"
#include "tests/recordings/sample.h"

namespace ferrobench::recordings {
namespace {

using ::testing::HasSubstr;
using testing::TemporaryFolder;

Recording small_recording() {
  auto r = testing::play(0, {{1e6, 1}, {1e6, 1}, {0, 1}}, 200);
  r.set(Channel::charge).assign(r.size(), 1e-4);
  r.set(Channel::displacement) = r.time;
  r.set(Channel::force).assign(r.size(), 200);
  r.header.model = {{"format", "ferrobench-model"}};
  r.header.past = {
      protocols::PastKind::visited, protocols::FirstState::partly_poled, {{-1e6, 1}, {0, 1}}, -0.4};
  r.events = {{0.5, "note", "here"}};
  return r;
}

// Opens the file and lets `change` damage it.
void change_file(const std::string& path, const std::function<void(hid_t)>& change) {
  const auto access = hdf5::unlocked_access();
  const auto file = hdf5::file(H5Fopen(path.c_str(), H5F_ACC_RDWR, access.get()));
  ASSERT_TRUE(file);
  change(file.get());
}

void put_numbers(hid_t file, const char* place, std::vector<double> values) {
  H5Ldelete(file, place, H5P_DEFAULT);
  const hsize_t size = values.size();
  const auto space = hdf5::space(H5Screate_simple(1, &size, nullptr));
  const auto set = hdf5::dataset(
      H5Dcreate2(file, place, H5T_NATIVE_DOUBLE, space.get(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
  H5Dwrite(set.get(), H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
}

// Claims `rows` elements without storing any.
void put_claim(hid_t file, const char* place, hsize_t rows, hsize_t chunk, hsize_t limit = 0) {
  H5Ldelete(file, place, H5P_DEFAULT);
  const auto space = hdf5::space(H5Screate_simple(1, &rows, limit == 0 ? nullptr : &limit));
  const auto how = hdf5::properties(H5Pcreate(H5P_DATASET_CREATE));
  H5Pset_chunk(how.get(), 1, &chunk);
  const auto set = hdf5::dataset(
      H5Dcreate2(file, place, H5T_NATIVE_DOUBLE, space.get(), H5P_DEFAULT, how.get(), H5P_DEFAULT));
  ASSERT_TRUE(set);
}

struct Damage {
  const char* name;
  std::function<void(hid_t)> make;
  const char* path;
  const char* message;
};

std::vector<double> rising(std::size_t count) {
  std::vector<double> out(count);
  for (std::size_t i = 0; i < count; ++i) out[i] = static_cast<double>(i);
  return out;
}

const std::vector<Damage>& damages() {
  static const std::vector<Damage> all{
      {"no_definition", [](hid_t f) { H5Ldelete(f, "/entry/definition", H5P_DEFAULT); }, "/entry/definition",
       "missing"},
      {"no_time", [](hid_t f) { H5Ldelete(f, "/entry/data/time", H5P_DEFAULT); }, "/entry/data/time",
       "missing"},
      {"no_area", [](hid_t f) { H5Ldelete(f, "/entry/sample/area_m2", H5P_DEFAULT); },
       "/entry/sample/area_m2", "missing"},
      {"no_load", [](hid_t f) { H5Ldelete(f, "/entry/load", H5P_DEFAULT); }, "/entry/load/spring", "missing"},
      {"no_reference", [](hid_t f) { H5Adelete_by_name(f, "/entry/data/charge", "reference", H5P_DEFAULT); },
       "/entry/data/charge@reference", "missing"},
      {"short_column", [](hid_t f) { put_numbers(f, "/entry/data/force", rising(10)); }, "/entry/data/force",
       "length"},
      {"time_stands", [](hid_t f) { put_numbers(f, "/entry/data/time", std::vector<double>(601, 1.0)); },
       "/entry/data/time", "does not rise at sample 1"},
      {"time_nan",
       [](hid_t f) {
         auto time = rising(601);
         time[300] = std::nan("");
         put_numbers(f, "/entry/data/time", time);
       },
       "/entry/data/time", "not finite at sample 300"},
      {"infinite",
       [](hid_t f) {
         put_numbers(f, "/entry/data/charge2", rising(2)),
             put_numbers(f, "/entry/data/force", std::vector<double>(601, INFINITY));
       },
       "/entry/data/force", "infinite"},
      {"negative_area", [](hid_t f) { put_numbers(f, "/entry/sample/area_m2", {-1}); },
       "/entry/sample/area_m2", "above zero"},
      {"area_list",
       [](hid_t f) {
         put_numbers(f, "/entry/sample/area_m2", {1, 2});
       },
       "/entry/sample/area_m2", "one number"},
      {"half_a_layer", [](hid_t f) { put_numbers(f, "/entry/sample/layer_count", {1.5}); },
       "/entry/sample/layer_count", "whole"},
      {"past_without_kind", [](hid_t f) { H5Ldelete(f, "/entry/sample/past/kind", H5P_DEFAULT); },
       "/entry/sample/past/kind", "missing"},
      {"past_of_no_kind",
       [](hid_t f) {
         H5Ldelete(f, "/entry/sample/past/kind", H5P_DEFAULT);
         H5Lcreate_hard(f, "/entry/definition", f, "/entry/sample/past/kind", H5P_DEFAULT, H5P_DEFAULT);
       },
       "/entry/sample/past/kind", "not a name"},
      {"past_without_poling", [](hid_t f) { H5Ldelete(f, "/entry/sample/past/poling", H5P_DEFAULT); },
       "/entry/sample/past/poling", "missing"},
      {"past_poled_beyond", [](hid_t f) { put_numbers(f, "/entry/sample/past/poling", {1.5}); },
       "/entry/sample/past/poling", "degree"},
      {"past_without_levels", [](hid_t f) { H5Ldelete(f, "/entry/sample/past/field", H5P_DEFAULT); },
       "/entry/sample/past/field", "missing"},
      {"past_nan",
       [](hid_t f) {
         put_numbers(f, "/entry/sample/past/field", {0, std::nan("")});
       },
       "/entry/sample/past/field", "level 1"},
      {"past_too_high",
       [](hid_t f) {
         put_numbers(f, "/entry/sample/past/field", {1e12, 0});
       },
       "/entry/sample/past/field", "level 0"},
      {"past_at_once",
       [](hid_t f) {
         put_numbers(f, "/entry/sample/past/seconds", {1, 0});
       },
       "/entry/sample/past/seconds", "level 1"},
      {"past_for_ever",
       [](hid_t f) {
         put_numbers(f, "/entry/sample/past/seconds", {INFINITY, 1});
       },
       "/entry/sample/past/seconds", "level 0"},
      {"past_short", [](hid_t f) { put_numbers(f, "/entry/sample/past/seconds", {1}); },
       "/entry/sample/past/seconds", "length"},
      {"past_endless", [](hid_t f) { put_numbers(f, "/entry/sample/past/field", rising(10001)); },
       "/entry/sample/past/field", "10000 levels"},
      {"text_is_number", [](hid_t f) { put_numbers(f, "/entry/title", {1}); }, "/entry/title", "text"},
      {"huge", [](hid_t f) { put_claim(f, "/entry/data/time", 1ull << 60, 1024); }, "/entry/data/time",
       "claims"},
      {"empty_claim", [](hid_t f) { put_claim(f, "/entry/data/time", 1000000000, 1024); }, "/entry/data/time",
       "claims"},
      {"huge_chunk", [](hid_t f) { put_claim(f, "/entry/data/time", 601, 1u << 26, H5S_UNLIMITED); },
       "/entry/data/time", ""},
      {"group_for_data",
       [](hid_t f) {
         H5Ldelete(f, "/entry/data/field", H5P_DEFAULT);
         hdf5::group(H5Gcreate2(f, "/entry/data/field", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
       },
       "/entry/data/field", "not a dataset"},
      {"data_for_group", [](hid_t f) { put_numbers(f, "/entry/load", {1}); }, "/entry/load", "not a group"},
      {"soft_cycle",
       [](hid_t f) {
         H5Ldelete(f, "/entry/data/field", H5P_DEFAULT);
         H5Lcreate_soft("/entry/data/field", f, "/entry/data/field", H5P_DEFAULT, H5P_DEFAULT);
       },
       "/entry/data/field", "link"},
      {"external_link",
       [](hid_t f) {
         H5Ldelete(f, "/entry/data/field", H5P_DEFAULT);
         H5Lcreate_external("/etc/passwd", "/x", f, "/entry/data/field", H5P_DEFAULT, H5P_DEFAULT);
       },
       "/entry/data/field", "link"},
      {"cyclic_group",
       [](hid_t f) {
         H5Ldelete(f, "/entry/data", H5P_DEFAULT);
         H5Lcreate_hard(f, "/entry", f, "/entry/data", H5P_DEFAULT, H5P_DEFAULT);
       },
       "/entry/data/", ""},
      {"external_storage",
       [](hid_t f) {
         H5Ldelete(f, "/entry/data/field", H5P_DEFAULT);
         const hsize_t size = 601;
         const auto space = hdf5::space(H5Screate_simple(1, &size, nullptr));
         const auto how = hdf5::properties(H5Pcreate(H5P_DATASET_CREATE));
         H5Pset_external(how.get(), "/etc/passwd", 0, size * 8);
         hdf5::dataset(H5Dcreate2(f, "/entry/data/field", H5T_NATIVE_DOUBLE, space.get(), H5P_DEFAULT,
                                  how.get(), H5P_DEFAULT));
       },
       "/entry/data/field", "another file"},
      {"segment_outside",
       [](hid_t f) {
         put_numbers(f, "/entry/segments/end_sample", {200, 400, 100000});
       },
       "/entry/segments/end_sample", "segment 2"},
      {"segment_rows",
       [](hid_t f) {
         put_numbers(f, "/entry/segments/level", {1, 2});
       },
       "/entry/segments/level", "length"},
  };
  return all;
}

class Hostile : public ::testing::TestWithParam<Damage> {};

TEST_P(Hostile, IsRefusedWithItsPlace) {
  const TemporaryFolder folder;
  const auto path = folder.file("x.h5");
  write_recording(path, small_recording());
  ASSERT_NO_THROW(read_recording(path));
  change_file(path, GetParam().make);
  try {
    read_recording(path);
    FAIL() << "was read";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::bad_recording);
    ASSERT_EQ(error.problems().size(), 1u);
    EXPECT_THAT(error.problems()[0].path, HasSubstr(GetParam().path));
    EXPECT_THAT(error.problems()[0].message, HasSubstr(GetParam().message));
  }
}
INSTANTIATE_TEST_SUITE_P(Each, Hostile, ::testing::ValuesIn(damages()),
                         [](const auto& each) { return std::string(each.param.name); });

std::string slurp(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

// Reads or refuses; anything else ends the test program.
bool reads(const std::string& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
  try {
    read_summary(path);
    read_recording(path);
    return true;
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::bad_recording) << error.what();
    return false;
  }
}

TEST(Damaged, BitFlipsAreReadOrRefused) {
  const TemporaryFolder folder;
  write_recording(folder.file("good.h5"), small_recording());
  const auto good = slurp(folder.file("good.h5"));
  std::mt19937_64 random(1);
  int refused = 0;
  for (int i = 0; i < 600; ++i) {
    auto bytes = good;
    for (int flips = 1 + i % 4; flips > 0; --flips)
      bytes[random() % bytes.size()] ^= static_cast<char>(1 << (random() % 8));
    refused += reads(folder.file("bad.h5"), bytes) ? 0 : 1;
  }
  EXPECT_GT(refused, 100);
}

TEST(Damaged, CutFilesAreReadOrRefused) {
  const TemporaryFolder folder;
  write_recording(folder.file("good.h5"), small_recording());
  const auto good = slurp(folder.file("good.h5"));
  for (std::size_t i = 0; i < 200; ++i)
    EXPECT_FALSE(reads(folder.file("bad.h5"), good.substr(0, good.size() * i / 200))) << i;
}

TEST(Damaged, OtherThingsAreNotRecordings) {
  const TemporaryFolder folder;
  EXPECT_FALSE(reads(folder.file("text.h5"), "time,field\n0,1\n"));
  EXPECT_FALSE(reads(folder.file("empty.h5"), ""));
  EXPECT_THROW(read_recording(folder.file("")), Error);
}

}  // namespace
}  // namespace ferrobench::recordings
