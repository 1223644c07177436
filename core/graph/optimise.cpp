#include "core/graph/optimise.h"

#include <ceres/ceres.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

#include "core/graph/residuals.h"
#include "core/graph/twist.h"

namespace roadvec {
namespace {

using Blocks = std::map<std::size_t, std::array<double, 3>>;  // keyframe -> x, y, theta

/// S with S^T S = information, also where the information is singular: by eigenvalues, not Cholesky.
Eigen::Matrix3d sqrt_of(const Eigen::Matrix3d& information) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(information);
  const Eigen::Vector3d roots = eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt();
  return roots.asDiagonal() * eigen.eigenvectors().transpose();
}

/// The way along odometry from one keyframe, step by step.
class Walk {
 public:
  void step(const PoseEdge& odometry) {
    const Eigen::Matrix3d to_start =
        adjoint(T_start_here_) * coordinates_at(odometry.T_from_to.translation()).inverse();
    covariance_ += to_start * odometry.information.inverse() * to_start.transpose();
    T_start_here_ = T_start_here_ * odometry.T_from_to;
  }
  [[nodiscard]] const Pose2& T_start_here() const { return T_start_here_; }
  [[nodiscard]] const Eigen::Matrix3d& covariance() const { return covariance_; }  ///< as a motion of the start's frame
  [[nodiscard]] PoseEdge edge(std::size_t from, std::size_t to) const {
    const Eigen::Matrix3d M = coordinates_at(T_start_here_.translation());
    const Eigen::Matrix3d information = (M * covariance_ * M.transpose()).inverse();
    return {from, to, T_start_here_, 0.5 * (information + information.transpose())};
  }

 private:
  Pose2 T_start_here_;
  Eigen::Matrix3d covariance_ = Eigen::Matrix3d::Zero();
};

/// The part of a graph that is solved for. nodes.front() stays where it is; `loops` end at a later one.
struct Part {
  std::vector<std::size_t> nodes;
  std::vector<PoseEdge> ways;  ///< odometry from each node to the next
  std::vector<LoopEdge*> loops;
};

Part part_of(PoseGraph& graph, std::size_t first_free, double node_spacing_m) {
  Part part;
  const std::size_t last = graph.poses_map.size() - 1, fixed = std::min(std::max<std::size_t>(first_free, 1) - 1, last);
  std::set<std::size_t> nodes{fixed, last};
  for (LoopEdge& loop : graph.loops) {
    if (loop.edge.to <= fixed) continue;
    part.loops.push_back(&loop);
    nodes.insert(loop.edge.to);
    if (loop.edge.from > fixed) nodes.insert(loop.edge.from);
  }
  Walk walk;
  double way_m = 0;
  part.nodes.push_back(fixed);
  for (std::size_t k = fixed + 1; k <= last; ++k) {
    walk.step(graph.odometry[k - 1]);
    way_m += graph.odometry[k - 1].T_from_to.translation().norm();
    if (!nodes.contains(k) && way_m < node_spacing_m) continue;
    part.ways.push_back(walk.edge(part.nodes.back(), k));
    part.nodes.push_back(k);
    walk = Walk();
    way_m = 0;
  }
  return part;
}

/// Between two nodes each keyframe moves by the share of the correction that its odometry's uncertainty has gathered:
/// the most probable poses between two known ends, to first order in the correction.
void spread(PoseGraph& graph, const PoseEdge& way) {
  Walk whole, walk;
  for (std::size_t k = way.from; k < way.to; ++k) whole.step(graph.odometry[k]);
  const Pose2 T_from_to = graph.poses_map[way.from].inverse() * graph.poses_map[way.to];
  const Eigen::Vector3d correction = log_of(T_from_to * whole.T_start_here().inverse());
  const Eigen::Vector3d weighed = whole.covariance().ldlt().solve(correction);
  for (std::size_t k = way.from + 1; k < way.to; ++k) {
    walk.step(graph.odometry[k - 1]);
    graph.poses_map[k] = graph.poses_map[way.from] * exp_of(walk.covariance() * weighed) * walk.T_start_here();
  }
}

void add_edge(ceres::Problem& problem, Blocks& blocks, const PoseEdge& edge, ceres::LossFunction* loss) {
  problem.AddResidualBlock(new RelativePoseCost(edge.T_from_to, sqrt_of(edge.information)), loss,
                           blocks.at(edge.from).data(), blocks.at(edge.to).data());
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

/// One solve over the part's odometry and active loops; its nodes change only if it succeeded.
bool solve(PoseGraph& graph, const Part& part, double loop_scale_sigma, int max_iterations, OptimiseReport& report) {
  Blocks blocks;
  const auto add_block = [&](std::size_t k) {
    const Pose2& pose = graph.poses_map[k];
    blocks.try_emplace(k, std::array{pose.x_m, pose.y_m, pose.theta_rad});
  };
  for (const std::size_t k : part.nodes) add_block(k);
  for (const LoopEdge* loop : part.loops) add_block(loop->edge.from);
  ceres::CauchyLoss loop_loss(loop_scale_sigma);
  ceres::Problem::Options problem_options;
  problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(problem_options);
  for (const PoseEdge& way : part.ways) add_edge(problem, blocks, way, nullptr);
  for (const LoopEdge* loop : part.loops) {
    if (loop->active) add_edge(problem, blocks, loop->edge, &loop_loss);
  }
  for (auto& [k, block] : blocks) {
    if (k <= part.nodes.front() && problem.HasParameterBlock(block.data())) {
      problem.SetParameterBlockConstant(block.data());
    }
  }
  ceres::Solver::Summary summary;
  ceres::Solve(solver_options(max_iterations), &problem, &summary);
  report.iteration_count += static_cast<int>(summary.iterations.size());
  ++report.round_count;
  if (report.round_count == 1) report.initial_cost = summary.initial_cost;
  report.final_cost = summary.final_cost;
  if (!summary.IsSolutionUsable()) return false;
  for (const std::size_t k : part.nodes) {
    const std::array<double, 3>& block = blocks.at(k);
    graph.poses_map[k] = {block[0], block[1], wrap_rad(block[2])};
  }
  return true;
}

/// The active loop that is furthest from the poses, if beyond the gate.
LoopEdge* worst_loop(const PoseGraph& graph, const Part& part, double gate_sigma) {
  LoopEdge* worst = nullptr;
  double worst_sigma = gate_sigma;
  for (LoopEdge* loop : part.loops) {
    const double error_sigma = loop->active ? edge_error_sigma(graph, loop->edge) : 0.0;
    if (error_sigma <= worst_sigma) continue;
    worst_sigma = error_sigma;
    worst = loop;
  }
  return worst;
}

}  // namespace

double edge_error_sigma(const PoseGraph& graph, const PoseEdge& edge) {
  const Eigen::Vector3d e = relative_pose_error(graph.poses_map[edge.from], graph.poses_map[edge.to], edge.T_from_to);
  return std::sqrt(std::max(0.0, e.dot(edge.information * e)));
}

OptimiseReport Optimiser::run(PoseGraph& graph, std::size_t first_free) const {
  OptimiseReport report;
  if (graph.odometry.empty()) return report;
  const Part part = part_of(graph, first_free, config_.node_spacing_m);
  report.node_count = part.nodes.size();
  const std::vector<Pose2> poses_before(graph.poses_map.begin() + static_cast<std::ptrdiff_t>(part.nodes.front()),
                                        graph.poses_map.end());
  const std::vector<LoopEdge> loops_before = graph.loops;
  for (LoopEdge* loop : part.loops) loop->active = true;
  // Graduated: a true loop may begin a hundred sigmas off, where a narrow loss would not feel it. [Yang2020]
  for (const double widening : {1000.0, 100.0, 10.0, 1.0}) {
    report.solved = solve(graph, part, widening * config_.loop_scale_sigma, config_.max_iterations, report);
    if (!report.solved) break;
  }
  report.round_count = 1;
  const auto worst = [&] { return worst_loop(graph, part, config_.loop_gate_sigma); };
  for (LoopEdge* loop = worst(); report.solved && loop != nullptr; loop = worst()) {
    loop->active = false;
    // In the last round every loop that is still contradicted goes before the solve.
    if (report.round_count + 1 < config_.max_rounds || worst() == nullptr) {
      report.solved = solve(graph, part, config_.loop_scale_sigma, config_.max_iterations, report);
    }
  }
  if (report.solved) {
    for (const PoseEdge& way : part.ways) spread(graph, way);
  } else {
    std::ranges::copy(poses_before, graph.poses_map.end() - static_cast<std::ptrdiff_t>(poses_before.size()));
    std::ranges::copy(loops_before, graph.loops.begin());
  }
  report.switched_off_count =
      static_cast<std::size_t>(std::ranges::count_if(graph.loops, [](const LoopEdge& loop) { return !loop.active; }));
  return report;
}

}  // namespace roadvec
