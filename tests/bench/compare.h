// The tables of ferrobench_compare, in Markdown on the standard output.
#pragma once

namespace ferrobench::bench {

void compare_time_stepping(double spring_stiffness);  // N/m; against CVODE and rosenbrock4
void compare_kernel();
void compare_quadrature();
void compare_recording();

}  // namespace ferrobench::bench
