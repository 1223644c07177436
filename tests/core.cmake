roadvec_test(core_base tests/core/base LINKS core_base)
roadvec_test(core_ring tests/core/ring LABEL threads LINKS core_base Threads::Threads)
roadvec_test(core_geometry tests/core/geometry LINKS core_base)
roadvec_test(core_odometry tests/core/odometry LINKS core_odometry)
roadvec_test(core_boundary tests/core/boundary LINKS core_boundary)
roadvec_test(core_map tests/core/map LINKS core_map)
roadvec_test(core_graph tests/core/graph LINKS core_graph)
roadvec_test(core_pipeline tests/core/pipeline LINKS core_pipeline)
roadvec_test(core_wire tests/core/wire LINKS core_wire)

# Kilometres: only without sanitizers.
roadvec_test(long_drive tests/long_drive LINKS core_pipeline)

roadvec_fuzz(wire LINKS core_wire)
roadvec_fuzz(packed_lines LINKS core_map)

roadvec_bench(odometry LINKS core_odometry)
roadvec_bench(boundary LINKS core_boundary)
roadvec_bench(map LINKS core_map)
roadvec_bench(graph LINKS core_graph)
roadvec_bench(long_drive LINKS core_pipeline)
