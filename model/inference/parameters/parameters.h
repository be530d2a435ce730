// Model values by their path in the model file, for fitting and for setting one from outside.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "model/inference/dataset/recording_data.h"
#include "model/model.h"

namespace ferrobench::model {

// "material.barrier", "polycrystal.barrier_log_std", "effects.electrostriction.coefficient", ...
// Both throw Error(invalid_params) with the nearest name if there is no such number in the model.
double get_parameter(const Model& model, std::string_view path);
Model with_parameters(const Model& model, const std::vector<std::pair<std::string, double>>& values);
// Sets one number to a value that is known to be allowed: nothing is checked, and no text is made and read
// for it. Throws as the others.
void set_parameter(Model& model, std::string_view path, double value);
// Every number of the model, in the file's order.
std::vector<std::string> parameter_paths(const Model& model);

// The path of a parameter of an effect, and whether a path is that of one of this effect's.
std::string effect_path(std::string_view id, std::string_view parameter);
bool is_of_effect(std::string_view path, std::string_view id);

// As the model file gives it: "J/m^3", "1".
std::string parameter_unit(std::string_view path);

// A parameter that a fit may move, within [low, high]; on a logarithmic scale if `logarithmic` (then low > 0,
// or both < 0).
struct FreeParameter {
  std::string path;
  double low = 0, high = 0;
  bool logarithmic = false;
};

// The physical range of a model parameter: what a fit may do unless told otherwise. Ranges for PZT from the
// literature's spread (soft and hard compositions, -20 to 100 degC), for effects from the catalogue. They are
// those of bulk specimens: where a specimen was driven farther than these are, as films are, what is a field
// or an energy density has a range that is as many times higher. Polarization and
// permittivities may be what the charge shows.
FreeParameter free_parameter(const Model& model, std::string_view path, const Evidence& evidence = {});

// Between a parameter and its place u in its range: 0 at `low`, 1 at `high`, and in between linear in the
// value or in its logarithm. A value outside the range goes to its nearer end.
double to_unit(const FreeParameter& p, double value);
double from_unit(const FreeParameter& p, double u);
// d value / d u.
double unit_slope(const FreeParameter& p, double u);

// Whether domains may switch: of a linear capacitor no field reaches the barrier.
bool switches(const Model& model);
// Whether nothing is estimated of a number: of the temperature, which only counts by its ratio to the
// activation volume; of an empirical table, which was fitted as a whole; and, where no domain
// switches, as no field reaches the barrier, of what only switching shows.
bool is_held(const Model& model, std::string_view path);

// Parameters that a fit frees if nothing is said: material and polycrystal without what no recording can tell
// (temperature), and the parameters of the model's effects. Spreads that are zero stay so: switching one on
// is an effect, not a fit. The bias field is free even at zero, for an amplifier's offset acts like one.
// Where neither strain nor stress shows, what makes them is not free; the interaction stresses are, for the
// charge depends on their product with the strain.
std::vector<FreeParameter> default_free_parameters(const Model& model, const Evidence& evidence = {});

}  // namespace ferrobench::model
