// How the noise of neighbouring samples goes together.
//
// Noise is taken as white plus, where the samples show it, an exponentially correlated part. With variance 1
// in all, samples k rows apart have the covariance
//
//   c(0) = 1,  c(k) = slow_share exp(-k / rows)
//
// It is found in the quiet windows of a channel: 96 samples each, detrended by a quartic, of which those
// count whose variance is at most 1.6 times what the quietest three tenths have; there the signal is smooth
// and noise is what is left. Their mean autocovariance over 24 lags is set beside what white and what
// correlated noise would show after the same detrending; correlation is believed where it explains two fifths
// of a misfit that white noise alone would not have. A tone (mains hum) is no noise and is taken out before.
// Where samples are few, a signal bends too much within 96 of them for any window to be quiet. It has the
// autocovariance of slow noise, but a polynomial of the eighth degree takes most of what the quartic leaves
// of it, and little of noise: then the noise counts as white.
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

namespace ferrobench::recordings {

struct NoiseColour {
  double slow_share = 0, rows = 0;  // rows = 0 where nothing but white noise is seen
  bool is_signal = false;           // what was seen beside white noise bends as a signal does
  double covariance(double rows_apart) const;
  // Second differences of such noise have this much times its variance; 6 if it is white.
  double second_differences() const;
};

class QuietWindows {
 public:
  static constexpr std::size_t length = 96;

  QuietWindows() = default;
  // Of a channel's samples, `scatter` times white noise at least: windows without gaps, their samples at
  // about equal distances, at most `most` of them, spread over the recording.
  QuietWindows(std::span<const double> time, std::span<const double> value, double scatter,
               std::size_t most = std::numeric_limits<std::size_t>::max());

  std::size_t size() const { return windows_.size(); }
  // The standard deviation of second differences over sqrt(6), without a tone, as a share of the scatter.
  double level() const;
  // Whether a tone stood out of them, so that the scatter is not that of noise alone.
  bool has_tone() const { return has_tone_; }

 private:
  friend void keep_quiet(std::span<QuietWindows> channels);
  friend NoiseColour colour_of(std::span<const QuietWindows> channels);

  void remove_tone();

  std::vector<std::array<double, length>> windows_;  // detrended, over unit_ times the scatter
  double unit_ = 1;
  bool has_tone_ = false;
};

// Of several recordings of one channel, measured alike: leaves the quiet windows, without their tones.
void keep_quiet(std::span<QuietWindows> channels);
// Of all of them together, at least eight windows; white with fewer.
NoiseColour colour_of(std::span<const QuietWindows> channels);

}  // namespace ferrobench::recordings
