"""The instruments that an endoscope sees: ros2 launch lapservo track.launch.py rig:=rig.yaml image:=/endoscope/image_raw"""
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
        cmd=['lapservo', 'track', 'ros2:' + resolved(argument('image')), '--rig', argument('rig'),
             *shlex.split(argument('options'))],
        output='screen', sigterm_timeout='15')]


def generate_launch_description():
    return LaunchDescription([
        DeclareLaunchArgument('rig', description='Camera and instruments: a YAML file'),
        DeclareLaunchArgument('namespace', default_value='', description='Stands before names that do not begin with /'),
        DeclareLaunchArgument('image', default_value='endoscope/image_raw', description='Topic of the images'),
        DeclareLaunchArgument('options', default_value='', description='More options, as lapservo track --help has them'),
        OpaqueFunction(function=start),
    ])
