// Another board, and an account of the voltage at output 0.
#pragma once

#include <chrono>
#include <cstdio>
#include <memory>
#include <string>
#include <system_error>

#include "unit/board.h"

namespace ferrobench::emulator {

class LoggedBoard final : public Board {
 public:
  // A line at each change: the unit's time [s], the time of day [s], volts.
  LoggedBoard(std::unique_ptr<Board> board, const std::string& path)
      : board_(std::move(board)), file_(std::fopen(path.c_str(), "w"), std::fclose) {
    if (!file_) throw std::system_error(errno, std::generic_category(), path);
    std::setvbuf(file_.get(), nullptr, _IOLBF, 1 << 12);
  }

  void output(Ticks time, unsigned channel, double volts) override {
    if (channel == 0 && volts != volts_) {
      volts_ = volts;
      const std::chrono::duration<double> day = std::chrono::system_clock::now().time_since_epoch();
      (void)std::fprintf(file_.get(), "%.6f %.6f %.6f\n",
                         static_cast<double>(time) / static_cast<double>(ticks_per_second), day.count(),
                         volts);
    }
    board_->output(time, channel, volts);
  }
  double input(Ticks time, const AnalogInput& input) override { return board_->input(time, input); }
  void digital_out(Ticks time, std::uint8_t levels, std::uint8_t driven) override {
    board_->digital_out(time, levels, driven);
  }
  std::uint8_t digital_in(Ticks time) override { return board_->digital_in(time); }

 private:
  std::unique_ptr<Board> board_;
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_;
  double volts_ = 0;
};

}  // namespace ferrobench::emulator
