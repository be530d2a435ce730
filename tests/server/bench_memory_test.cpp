// What a run asks of the memory once it has begun: nothing, in the thread that feeds the device and in the
// one that writes the journal. The device is one that only plays: that the driver's thread asks for none is
// tested with the emulated unit (tests/usb/driver_memory_test.cpp), and the model of the virtual device asks
// for memory as it computes.
#include <gtest/gtest.h>

#include <memory>

#include "protocols/protocol.h"
#include "recordings/format/iso_time.h"
#include "recordings/journal/writer.h"
#include "server/bench/run.h"
#include "tests/base/counted_memory.h"
#include "tests/daq/faulty_device.h"
#include "tests/server/engine_bench.h"

namespace ferrobench::bench {
namespace {

using namespace counted;

// Thousands of segments with long labels, one of each kind among them, at most 1 kV/mm.
protocols::Waveform program() {
  auto segments = nlohmann::json::array();
  for (int i = 0; i < 2000; ++i) {
    const auto label = "a label that is longer than what a string has room for: " + std::to_string(i);
    segments.push_back({{"kind", "ramp"}, {"to", 1}, {"time", 0.05}, {"label", label}});
    segments.push_back({{"kind", "hold"}, {"time", 0.05}, {"label", label}, {"readings_per_decade", 10}});
    segments.push_back({{"kind", "ramp"}, {"to", 0}, {"time", 0.05}});
    segments.push_back({{"kind", "sine"}, {"amplitude", 0.5}, {"frequency", 10}});
  }
  return protocols::Protocol::from_json({{"format", "ferrobench-protocol"},
                                         {"version", 1},
                                         {"name", "memory"},
                                         {"title", "Memory"},
                                         {"unit", "kV/mm"},
                                         {"start", 0},
                                         {"sample_rate_Hz", 1000},
                                         {"segments", std::move(segments)}})
      .expand();
}

// Plays the program, and counts from the first word of each thread until most of it has come. A thread of the
// run ends that, which is never more than all blocks behind the device: the end of the run, which may ask for
// memory, is farther away.
void play(const std::shared_ptr<daq::Device>& device, double rate) {
  // In memory: of a disk that is slow because others write to it an event is noted, which asks for memory.
  const server::Folder folder("/dev/shm");
  const auto path = (folder.path / "run.h5.journal").string();
  const daq::Scaling scaling(device->columns(), device->signals(), rate);
  recordings::Descriptor journal =
      recordings::JournalWriter(
          path, {{}, {scaling.channels().begin(), scaling.channels().end()}, device->columns()})
          .file();
  std::atomic<bool> begun = false;
  std::atomic<std::uint64_t> most = 0;
  std::atomic<const Run*> played = nullptr;
  Run run(device, {.rate = rate, .limits = {.slew = 1e9}, .program = Program::of(program())}, [&] {
    watched = true;  // in the threads of the run
    begun = true;
    if (played.load()->state().rows >= most) counting = false;
  });
  played = &run;
  most = run.prepared().size * 9 / 10;
  ASSERT_GT(most, 50'000u);  // more than all blocks that go round
  asked = 0;
  counting = true;
  run.begin({.path = path, .start_time = recordings::iso_now()}, std::move(journal), false);
  while (!run.over() && counting) usleep(1000);
  EXPECT_GE(run.state().rows, most) << run.state().reason;
  EXPECT_TRUE(begun);
  EXPECT_LT(run.state().rows_on_disk, run.state().rows);  // of the holds some rows only
  EXPECT_EQ(asked, 0) << "the first time for " << asked_first << " bytes";
}

TEST(BenchMemory, ARunThatHasBegunAsksForNone) {
  const auto device = std::make_shared<daq::FaultyDevice>(daq::Limits{});
  play(device, 1000);
}

}  // namespace
}  // namespace ferrobench::bench
