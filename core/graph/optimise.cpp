#include "core/graph/optimise.h"

#include <ceres/ceres.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>

#include "core/graph/residuals.h"

namespace roadvec {
namespace {

using Blocks = std::vector<std::array<double, 3>>;

/// S with S^T S = information, also where the information is singular: by eigenvalues, not Cholesky.
Eigen::Matrix3d sqrt_of(const Eigen::Matrix3d& information) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(information);
  const Eigen::Vector3d roots = eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt();
  return roots.asDiagonal() * eigen.eigenvectors().transpose();
}

void add_edge(ceres::Problem& problem, Blocks& blocks, const PoseEdge& edge, ceres::LossFunction* loss) {
  problem.AddResidualBlock(new RelativePoseCost(edge.T_from_to, sqrt_of(edge.information)), loss,
                           blocks[edge.from].data(), blocks[edge.to].data());
}

ceres::Solver::Options solver_options(int max_iterations) {
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  // Eigen's solver and not SuiteSparse: the latter calls a BLAS whose thread count may change the last bits.
  options.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;
  options.num_threads = 1;
  options.max_num_iterations = max_iterations;
  options.max_solver_time_in_seconds = 1e9;
  options.function_tolerance = 1e-8;
  options.logging_type = ceres::SILENT;
  return options;
}

/// One solve over odometry and the active loops; poses change only if it succeeded.
bool solve(PoseGraph& graph, double loop_scale_sigma, int max_iterations, OptimiseReport& report) {
  Blocks blocks(graph.poses_map.size());
  for (std::size_t k = 0; k < blocks.size(); ++k) {
    blocks[k] = {graph.poses_map[k].x_m, graph.poses_map[k].y_m, graph.poses_map[k].theta_rad};
  }
  ceres::CauchyLoss loop_loss(loop_scale_sigma);
  ceres::Problem::Options problem_options;
  problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(problem_options);
  for (const PoseEdge& edge : graph.odometry) add_edge(problem, blocks, edge, nullptr);
  for (const LoopEdge& loop : graph.loops) {
    if (loop.active) add_edge(problem, blocks, loop.edge, &loop_loss);
  }
  problem.SetParameterBlockConstant(blocks.front().data());
  ceres::Solver::Summary summary;
  ceres::Solve(solver_options(max_iterations), &problem, &summary);
  report.iteration_count += static_cast<int>(summary.iterations.size());
  ++report.round_count;
  if (report.round_count == 1) report.initial_cost = summary.initial_cost;
  report.final_cost = summary.final_cost;
  if (!summary.IsSolutionUsable()) return false;
  for (std::size_t k = 0; k < blocks.size(); ++k) {
    graph.poses_map[k] = {blocks[k][0], blocks[k][1], wrap_rad(blocks[k][2])};
  }
  return true;
}

/// The active loop that is furthest from the poses, if beyond the gate.
LoopEdge* worst_loop(PoseGraph& graph, double gate_sigma) {
  LoopEdge* worst = nullptr;
  double worst_sigma = gate_sigma;
  for (LoopEdge& loop : graph.loops) {
    const double error_sigma = loop.active ? edge_error_sigma(graph, loop.edge) : 0.0;
    if (error_sigma <= worst_sigma) continue;
    worst_sigma = error_sigma;
    worst = &loop;
  }
  return worst;
}

}  // namespace

double edge_error_sigma(const PoseGraph& graph, const PoseEdge& edge) {
  const Eigen::Vector3d e = relative_pose_error(graph.poses_map[edge.from], graph.poses_map[edge.to], edge.T_from_to);
  return std::sqrt(std::max(0.0, e.dot(edge.information * e)));
}

OptimiseReport Optimiser::run(PoseGraph& graph) const {
  OptimiseReport report;
  if (graph.odometry.empty()) return report;
  for (LoopEdge& loop : graph.loops) loop.active = true;
  // Graduated: a true loop may begin a hundred sigmas off, where a narrow loss would not feel it. [Yang2020]
  for (const double widening : {1000.0, 100.0, 10.0, 1.0}) {
    report.solved = solve(graph, widening * config_.loop_scale_sigma, config_.max_iterations, report);
    if (!report.solved) break;
  }
  report.round_count = 1;
  for (LoopEdge* worst = worst_loop(graph, config_.loop_gate_sigma); report.solved && worst != nullptr;
       worst = worst_loop(graph, config_.loop_gate_sigma)) {
    worst->active = false;
    // In the last round every loop that is still contradicted goes before the solve.
    if (report.round_count + 1 < config_.max_rounds || worst_loop(graph, config_.loop_gate_sigma) == nullptr) {
      report.solved = solve(graph, config_.loop_scale_sigma, config_.max_iterations, report);
    }
  }
  report.switched_off_count =
      static_cast<std::size_t>(std::ranges::count_if(graph.loops, [](const LoopEdge& loop) { return !loop.active; }));
  return report;
}

}  // namespace roadvec
