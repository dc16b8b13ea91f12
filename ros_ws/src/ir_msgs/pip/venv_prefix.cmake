# Read by CMake right after project() when the package is built with pip; see pyproject.toml.
# A colcon build on a machine with ROS 2 from apt never reads it.
#
# Two things differ between ROS 2 from apt and ROS 2 from wheels, and both are settled here, without touching
# a file of the installed wheels.

find_package(Python3 REQUIRED COMPONENTS Interpreter Development.Module NumPy)

# (a) The prefix. The wheels' data scheme makes sys.prefix an ament prefix; with build isolation the prefix is
#     the builder's temporary one. Its share/ament_index says which of the candidates it is.
execute_process(
  COMMAND "${Python3_EXECUTABLE}" "${CMAKE_CURRENT_LIST_DIR}/ament_prefix.py"
  OUTPUT_VARIABLE venv_prefix
  OUTPUT_STRIP_TRAILING_WHITESPACE
  COMMAND_ERROR_IS_FATAL ANY)
message(STATUS "ament prefix of the wheels: ${venv_prefix}")
set(ENV{AMENT_PREFIX_PATH} "${venv_prefix}")
list(PREPEND CMAKE_PREFIX_PATH "${venv_prefix}")

# The libraries lie side by side in <prefix>/lib and find each other there.
list(APPEND CMAKE_INSTALL_RPATH "$ORIGIN")

# (b) The headers. The imported Python targets of the message packages name the headers of the machine that
#     built the wheels. They get this interpreter's once all of them are known, at the end of configuring.
function(use_own_python_headers)
  get_property(imported DIRECTORY PROPERTY IMPORTED_TARGETS)
  foreach(target IN LISTS imported)
    get_target_property(includes ${target} INTERFACE_INCLUDE_DIRECTORIES)
    if(NOT includes MATCHES "/opt/python/")
      continue()
    endif()
    list(FILTER includes EXCLUDE REGEX "^/opt/python/")
    list(APPEND includes ${Python3_INCLUDE_DIRS} ${Python3_NumPy_INCLUDE_DIRS})
    set_property(TARGET ${target} PROPERTY INTERFACE_INCLUDE_DIRECTORIES "${includes}")
  endforeach()
endfunction()
cmake_language(DEFER CALL use_own_python_headers)

# Joining the generated sources halves the build: most of its time goes into reading the same headers again.
# Two kinds can't be joined and stay single: type descriptions hold equal private names in every file, and the
# C++ introspection specialises a template in one file that another one has already used.
set(CMAKE_UNITY_BUILD ON)
set(CMAKE_UNITY_BUILD_BATCH_SIZE 12)
function(keep_single_what_cannot_be_joined)
  get_property(targets DIRECTORY PROPERTY BUILDSYSTEM_TARGETS)
  foreach(target IN LISTS targets)
    if(target MATCHES "__rosidl_typesupport_introspection_cpp$")
      set_property(TARGET ${target} PROPERTY UNITY_BUILD OFF)
    endif()
    get_target_property(sources ${target} SOURCES)
    list(FILTER sources INCLUDE REGEX "__description\\.c$")
    set_property(SOURCE ${sources} PROPERTY SKIP_UNITY_BUILD_INCLUSION ON)
  endforeach()
endfunction()
cmake_language(DEFER CALL keep_single_what_cannot_be_joined)
