"""A simulated arm and its endoscope: ros2 launch lapservo sim_robot.launch.py rig:=paper.yaml namespace:=/or1"""
import shlex

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction
from launch.substitutions import LaunchConfiguration


def start(context):
    def argument(name):
        return LaunchConfiguration(name).perform(context)

    def resolved(name):  # as ROS 2 does: a name that begins with / stands in no namespace
        return name if name.startswith('/') else f"{argument('namespace').rstrip('/')}/{name}"

    return [ExecuteProcess(
        cmd=['lapservo', 'sim-robot', '--rig', argument('rig'), '--arm', resolved(argument('arm')),
             '--camera', resolved(argument('camera')), *shlex.split(argument('options'))],
        output='screen', sigterm_timeout='15')]


def generate_launch_description():
    return LaunchDescription([
        DeclareLaunchArgument('rig', description='The scene before the camera: a YAML file'),
        DeclareLaunchArgument('namespace', default_value='', description='Stands before names that do not begin with /'),
        DeclareLaunchArgument('arm', default_value='SIM_PSM1', description="Namespace of the arm's CRTK topics"),
        DeclareLaunchArgument('camera', default_value='endoscope', description='Namespace of image_raw and camera_info'),
        DeclareLaunchArgument('options', default_value='', description='More options, as lapservo sim-robot --help has them'),
        OpaqueFunction(function=start),
    ])
