#pragma once

#include <cmath>
#include <limits>

#include "core/boundary/window.h"

namespace roadvec {

/// Visits, in order, every cell of the window that the ray from (x, y) in window coordinates passes through, until
/// visit(index, column, row) returns false or the window ends. Exact [AmanatidesWoo1987]: consecutive cells share an
/// edge, so a ray cannot slip through a diagonal wall one cell thick, and the window's last cells are cells like any
/// other.
template <class Visit>
void walk_ray(const Window& window, double x_m, double y_m, double direction_x, double direction_y, Visit&& visit) {
  const double cell_m = window.cell_m();
  const int size = window.size();
  int column = static_cast<int>(std::floor(x_m / cell_m)), row = static_cast<int>(std::floor(y_m / cell_m));
  if (column < 0 || row < 0 || column >= size || row >= size) return;
  const int step_c = direction_x < 0 ? -1 : 1, step_r = direction_y < 0 ? -1 : 1;
  const int end_c = step_c < 0 ? -1 : size, end_r = step_r < 0 ? -1 : size;
  constexpr double kNever = std::numeric_limits<double>::infinity();
  const auto to_edge = [cell_m](double p_m, int cell, int step, double direction) {
    return direction == 0 ? kNever : ((step > 0 ? cell + 1 : cell) * cell_m - p_m) / direction;
  };
  double next_c = to_edge(x_m, column, step_c, direction_x), next_r = to_edge(y_m, row, step_r, direction_y);
  const double delta_c = direction_x == 0 ? kNever : cell_m / std::abs(direction_x);
  const double delta_r = direction_y == 0 ? kNever : cell_m / std::abs(direction_y);
  int index = window.index(column, row);
  while (visit(index, column, row)) {
    if (next_c < next_r) {
      column += step_c;
      if (column == end_c) return;
      index += step_c;
      next_c += delta_c;
    } else {
      row += step_r;
      if (row == end_r) return;
      index += step_r * size;
      next_r += delta_r;
    }
  }
}

}  // namespace roadvec
