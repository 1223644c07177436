# Puts the scenes that ship with roadvec-simulate into the program: ROADVEC_SCENES_SOURCE is a generated .cpp file.
file(GLOB scene_files CONFIGURE_DEPENDS ${CMAKE_CURRENT_LIST_DIR}/scenes/*.toml)
set(scene_entries "")
foreach(scene_file ${scene_files})
  set_property(DIRECTORY ${CMAKE_SOURCE_DIR} APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${scene_file})
  get_filename_component(scene_name ${scene_file} NAME_WE)
  file(READ ${scene_file} scene_text)
  string(APPEND scene_entries "    {\"${scene_name}\", R\"SCENE(${scene_text})SCENE\"},\n")
endforeach()
set(ROADVEC_SCENES_SOURCE ${CMAKE_BINARY_DIR}/generated/shipped_scenes.cpp)
file(CONFIGURE OUTPUT ${ROADVEC_SCENES_SOURCE} CONTENT [[
#include "tools/simulate/scene_file.h"

namespace roadvec {
namespace {

constexpr ShippedScene kScenes[] = {
@scene_entries@};

}  // namespace

std::span<const ShippedScene> shipped_scenes() { return kScenes; }

}  // namespace roadvec
]] @ONLY)
