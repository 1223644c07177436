#pragma once

#include "core/boundary/fuse.h"
#include "core/boundary/segment.h"
#include "core/boundary/simplify.h"
#include "core/boundary/vectorise.h"
#include "core/boundary/virtual_scan.h"
#include "core/boundary/window.h"
#include "core/graph/close_loop.h"
#include "core/graph/optimise.h"
#include "core/map/concatenate.h"
#include "core/map/match.h"
#include "core/odometry/odometry.h"
#include "core/pipeline/keyframe.h"

namespace roadvec {

/// Every step's configuration, joined. `visit_fields(config, field)` calls, in the order of the flowchart,
///   field("step.name_unit", double& or int& value, min, max, "meaning")   or   field("step.name", bool& value,
///   "meaning").
/// From this one list come the parser, the range check, `roadvecd --print-config` and config/roadvecd.toml.
struct PipelineConfig {
  OdometryConfig odometry;
  WindowConfig window;
  SegmentConfig segment;
  VirtualScanConfig virtual_scan;
  MatchConfig match;
  FuseConfig fuse;
  VectoriseConfig vectorise;
  SimplifyConfig simplify;
  KeyframeConfig keyframe;
  CloseLoopConfig close_loop;
  OptimiseConfig optimise;
  ConcatenateConfig concatenate;
};
template <class Visitor>
void visit_fields(PipelineConfig& c, Visitor&& field) {
  visit_fields(c.odometry, field);
  visit_fields(c.window, field);
  visit_fields(c.segment, field);
  visit_fields(c.virtual_scan, field);
  visit_fields(c.match, field);
  visit_fields(c.fuse, field);
  visit_fields(c.vectorise, field);
  visit_fields(c.simplify, field);
  visit_fields(c.keyframe, field);
  visit_fields(c.close_loop, field);
  visit_fields(c.optimise, field);
  visit_fields(c.concatenate, field);
}

}  // namespace roadvec
