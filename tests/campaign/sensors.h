// The twin's sensors: what they show of charge, displacement and force.
#pragma once

#include <deque>

#include "tests/campaign/terms.h"

namespace ferrobench::campaign {

// y of tau y' + y = u for u linear from u0 to u1 over h.
double low_pass(double y, double u0, double u1, double h, double tau);

struct Seen {
  double field = 0, charge = 0, displacement = 0, force = 0;
};

class Sensors {
 public:
  // `rest_force`: sigma_pre A.
  Sensors(const Terms& terms, double rest_force) : t_(terms), rest_force_(rest_force) {}
  // True values (field at the monitor); the first call is the start.
  Seen look(double time, const Seen& truth);

 private:
  double charge(double h, double q);
  double displacement(double time, double h, double x, double field);
  double force(double h, double f, double field);

  Terms t_;
  double rest_force_;
  bool started_ = false;
  double last_time_ = 0;
  Seen last_;
  double first_charge_ = 0, integrated_ = 0, absorbed_ = 0;
  double before_lag_ = 0, lagged_ = 0, played_ = 0;
  double crept_ = 0, before_cell_lag_ = 0, cell_ = 0;
  std::deque<std::pair<double, double>> history_;
};

}  // namespace ferrobench::campaign
